"""Cancel, timeout and memory limit end the worker at once; the service lives on."""

from __future__ import annotations

import io
import itertools
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import psutil
import pytest

from tests.e2e.test_events import follow
from tests.factories.processes import forkserver, workers
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, finished, running_server
from tests.factories.slow import SLOW, slow_pair
from tests.factories.waiting import until

GOOD = as_npy(arms(1))


GONE_S = 20
"""Far less than the work would go on; `python -m benchmarks load` prints what it takes."""


def assert_gone(server: Server) -> None:
    """No worker runs, and none left a file behind."""
    scratch = server.data_dir / "scratch"
    until(lambda: not workers(server) and not list(scratch.iterdir()), within_s=GONE_S)


def assert_works(server: Server) -> None:
    seed = f'{{"seed": {time.monotonic_ns() % 10**9}}}'
    assert server.submit(GOOD, GOOD, wait=60, options=seed).json()["status"] == "succeeded"


class Drip(BaseHTTPRequestHandler):
    """A file that never ends coming."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        for _ in range(600):
            try:
                self.wfile.write(b"0")
            except OSError:
                return
            time.sleep(0.1)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    directory = tmp_path_factory.mktemp("kills")
    with running_server(directory, private_networks="127.0.0.0/8") as running:
        yield running


@pytest.fixture(scope="module")
def drip() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), Drip) as files:
        threading.Thread(target=files.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{files.server_port}/drip"
        files.shutdown()


def big_text(rows: int) -> bytes:
    text = io.StringIO()
    np.savetxt(text, arms(3, rows), fmt="%.6f")
    return text.getvalue().encode()


def cancel_in(server: Server, job_id: str, stage: str) -> bool:
    """DELETE as soon as the stage is seen; False when the job was faster."""
    for event in follow(server.client, job_id):
        if event["stage"] == stage:
            break
        assert event["stage"] != "finished", f"{stage} was never seen"
    answer = server.client.delete(f"/v1/registrations/{job_id}")
    if answer.status_code == 204:
        return False
    assert answer.json()["status"] == "cancelled"
    assert_gone(server)
    assert server.client.get(f"/v1/registrations/{job_id}").json()["status"] == "cancelled"
    return True


def test_cancel_while_fetching(server: Server, drip: str) -> None:
    urls = {"source": {"url": drip}, "target": {"url": drip}}
    job = server.client.post("/v1/registrations", json=urls).json()
    assert cancel_in(server, job["id"], "fetch")
    assert_works(server)


def test_cancel_while_decoding(server: Server) -> None:
    cancel_some(server, big_text(400_000), GOOD, "decode")
    assert_works(server)


@pytest.mark.parametrize("stage", ["prepare", "search", "refine", "inliers"])
def test_cancel_while_registering(server: Server, stage: str) -> None:
    count = 400_000 if stage == "inliers" else 10_000
    # two samples: equal clouds need no search
    cancel_some(server, as_npy(arms(4, count)), as_npy(arms(6, count)), stage)
    assert_works(server)


def cancel_some(server: Server, source: bytes, target: bytes, stage: str) -> None:
    """A job may be through the stage before the cancel comes: then another one is tried."""
    seeds = itertools.count()

    def one() -> bool:
        job = server.submit(source, target, options=f'{{"seed": {next(seeds)}}}').json()
        return cancel_in(server, job["id"], stage)

    until(one, within_s=250)


def busy_worker(server: Server) -> psutil.Process:
    """The worker that is at a slow job, once it computes."""
    (worker,) = until(lambda: [w for w in workers(server) if sum(w.cpu_times()[:2]) > 0.5])
    return worker


def test_cancel_in_native_code(server: Server) -> None:
    job = server.submit(*slow_pair(), options=SLOW).json()
    busy_worker(server)
    assert server.client.delete(f"/v1/registrations/{job['id']}").json()["status"] == "cancelled"
    assert_gone(server)
    assert_works(server)


def test_timeout_in_native_code(tmp_path: Path) -> None:
    with running_server(tmp_path, job_timeout_s=4.5) as server:
        job = server.submit(*slow_pair(), options=SLOW, wait=60).json()
        assert job["status"] == "failed"
        assert job["error"]["type"] == "urn:mpe:problem:job-timeout"
        assert "4.5 s" in job["error"]["detail"]
        assert 4.5 <= job["timing"]["total_s"] < 4.5 + GONE_S
        assert_gone(server)
        assert_works(server)


def test_a_cloud_that_the_memory_does_not_hold_is_refused(tmp_path: Path) -> None:
    rows = "".join(f"{x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in arms(5, 800_000).tolist())
    cloud = (
        '<VTKFile type="PolyData" version="1.0"><PolyData><Piece NumberOfPoints="800000"><Points>'
        f'<DataArray type="Float32" NumberOfComponents="3" format="ascii">{rows}</DataArray>'
        "</Points></Piece></PolyData></VTKFile>"
    ).encode()
    with running_server(tmp_path, job_memory_bytes=2**30) as server:
        job = finished(server.client, server.submit(cloud, cloud).json()["id"])
        assert job["status"] == "failed", job
        assert job["error"]["type"] == "urn:mpe:problem:unreadable-cloud"
        assert "decoded as a whole" in job["error"]["detail"]
        assert_gone(server)
        assert_works(server)


def test_a_killed_worker_is_replaced_three_times(server: Server) -> None:
    job = server.submit(*slow_pair(), options=SLOW).json()
    for attempt in (1, 2, 3):
        url = f"/v1/registrations/{job['id']}"
        until(lambda url=url, least=attempt: server.client.get(url).json()["attempt"] >= least)
        busy_worker(server).kill()
    ended = finished(server.client, job["id"])
    assert ended["status"] == "failed"
    assert ended["error"]["type"] == "urn:mpe:problem:worker-lost"
    assert "SIGKILL" in ended["error"]["detail"]
    assert_works(server)


def test_a_killed_forkserver_is_replaced(server: Server) -> None:
    job = server.submit(*slow_pair(), options=SLOW).json()
    orphan = busy_worker(server)
    forkserver(server).kill()
    orphan.wait(timeout=GONE_S)
    server.client.delete(f"/v1/registrations/{job['id']}")
    assert_works(server)
