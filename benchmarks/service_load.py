"""The service under load: many clients, large clouds, and what HTTP costs."""

from __future__ import annotations

import asyncio
import http.client
import io
import itertools
import json
import statistics
import tempfile
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
import psutil
from scipy.spatial.transform import Rotation

from benchmarks.experiment import DATA, Experiment, Result, markdown
from mpe_core import RegistrationOptions
from service.auth.keys import DEFAULT_TENANT
from service.clouds.inputs import CloudInput
from service.formats import read_points
from service.jobs.model import JobRow
from service.runtime import open_runtime
from service.settings import Settings
from service.telemetry.metrics import Metrics
from tests.factories.processes import workers
from tests.factories.server import Server, running_server
from tests.factories.slow import SLOW, slow_pair
from tests.factories.waiting import until

CLIENTS = 64
LOAD_S = 60
RAMP_S = 6
JOBS_WITHOUT_HTTP = 120
DISPATCHES = 50
CANCELS = 20
BOUNDARY = "load"
PATH = "/v1/registrations"


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    source, target = _bunny()
    with _server() as server:
        dispatch_ms, cancel_ms = _dispatch(server), _cancel(server)
    before = _without_http(source, target)
    with _server() as server:
        load = Load(server, source, target)
        load.run()
    after = _without_http(source, target)
    return {
        "bytes": len(source) + len(target),
        "dispatch_ms": dispatch_ms,
        "cancel_ms": cancel_ms,
        "jobs_per_s_without_http": [before, after],
        **load.figures(),
    }


@contextmanager
def _server() -> Iterator[Server]:
    with tempfile.TemporaryDirectory() as directory, running_server(Path(directory)) as server:
        yield server


class Load:
    """Clients that submit, get, list, wait for the end and submit again."""

    def __init__(self, server: Server, source: bytes, target: bytes) -> None:
        self._server = server
        self._head, self._tail = _form(source, target)
        self._seeds = itertools.count()
        self._times: dict[str, list[float]] = defaultdict(list)
        self._statuses: Counter[int] = Counter()
        self._done: list[float] = []
        self._memory: list[float] = []

    def run(self) -> None:
        """Run all clients for LOAD_S seconds."""
        self._start = time.perf_counter()
        self._end = self._start + LOAD_S
        watcher = threading.Thread(target=self._watch_memory)
        watcher.start()
        with ThreadPoolExecutor(CLIENTS) as clients:
            for client in [clients.submit(self._client, i) for i in range(CLIENTS)]:
                client.result()
        watcher.join()

    def figures(self) -> Result:
        """Return rates, latencies, statuses and memory."""
        in_time = [moment for moment in self._done if moment <= self._end]
        third = len(self._memory) // 3
        return {
            "clients": CLIENTS,
            "seconds": LOAD_S,
            "statuses": dict(self._statuses),
            "jobs_per_s": len(in_time) / LOAD_S,
            "calls": {name: _spread(times) for name, times in self._times.items()},
            "service_mib": {
                "first third": max(self._memory[:third]) / 2**20,
                "last third": max(self._memory[-third:]) / 2**20,
            },
        }

    def _client(self, number: int) -> None:
        time.sleep(RAMP_S * number / CLIENTS)
        connection = http.client.HTTPConnection("127.0.0.1", self._server.port, timeout=120)
        while time.perf_counter() < self._end:
            answer = self._call(connection, "submit", "POST", PATH, self._body())
            url = f"{PATH}/{json.loads(answer)['id']}"
            self._call(connection, "look", "GET", url)
            self._call(connection, "list", "GET", f"{PATH}?limit=20")
            self._wait(connection, url)
            self._done.append(time.perf_counter())
        connection.close()

    def _wait(self, connection: http.client.HTTPConnection, url: str) -> None:
        """Wait until it has succeeded; reads only the start of the answer of half a megabyte."""
        answer = b'"queued"'
        while b'"queued"' in answer or b'"running"' in answer:
            whole = self._exchange(connection, "GET", url, (), {"Prefer": "wait=60"})
            answer = whole[:100]
        assert b'"succeeded"' in answer, answer

    def _call(
        self,
        connection: http.client.HTTPConnection,
        name: str,
        method: str,
        url: str,
        body: tuple[bytes, ...] = (),
    ) -> bytes:
        started = time.perf_counter()
        headers = {"Content-Type": f"multipart/form-data; boundary={BOUNDARY}"} if body else {}
        answer = self._exchange(connection, method, url, body, headers)
        self._times[name].append(time.perf_counter() - started)
        return answer

    def _exchange(
        self,
        connection: http.client.HTTPConnection,
        method: str,
        url: str,
        body: tuple[bytes, ...],
        headers: dict[str, str],
    ) -> bytes:
        length = {"Content-Length": str(sum(map(len, body)))} if body else {}
        connection.request(method, url, body or None, headers | length)
        response = connection.getresponse()
        self._statuses[response.status] += 1
        return response.read()

    def _body(self) -> tuple[bytes, ...]:
        """Return the parts of a request body with a new seed, because equal work is done only once.

        The parts are not joined, to leave the processor to the service.
        """
        return self._head, f'{{"seed": {next(self._seeds)}}}'.encode(), self._tail

    def _watch_memory(self) -> None:
        process = psutil.Process(self._server.pid)
        while time.perf_counter() < self._end:
            self._memory.append(process.memory_info().rss)
            time.sleep(0.5)


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    calls = [
        (name, spread["count"], 1000 * spread["median"], 1000 * spread["p99"])
        for name, spread in result["calls"].items()
    ]
    before, after = result["jobs_per_s_without_http"]
    share = result["jobs_per_s"] / statistics.mean((before, after))
    memory = result["service_mib"]
    errors = sum(count for code, count in result["statuses"].items() if int(code) >= 500)
    return (
        f"{result['clients']} clients post pairs of 35,947 points ({result['bytes']:,} bytes) for "
        f"{result['seconds']} s (the clients start over the first {RAMP_S} s), wait for the end "
        "and post again.\n\n"
        + markdown(("call", "count", "median ms", "p99 ms"), calls)
        + f"\n\n{result['jobs_per_s']:.2f} registrations/s over HTTP, "
        f"{before:.2f} before and {after:.2f} after by the same workers without HTTP: "
        f"{share:.0%} of their mean. "
        f"Answers with a 5xx status: {errors}. "
        f"Memory of the service process at most {memory['first third']:.0f} MiB in the first "
        f"third, {memory['last third']:.0f} MiB in the last. "
        f"From accepted to a running child on the idle service: median "
        f"{result['dispatch_ms']['median']:.1f} ms; from a cancel to the end of a child that is in "
        f"native code: median {result['cancel_ms']['median']:.1f} ms, "
        f"p99 {result['cancel_ms']['p99']:.1f} ms."
    )


def _without_http(source: bytes, target: bytes) -> float:
    """Measure the registrations a second of jobs that are put straight into the store."""
    with tempfile.TemporaryDirectory() as directory:
        return asyncio.run(_by_store(Path(directory), source, target))


async def _by_store(directory: Path, source: bytes, target: bytes) -> float:
    with open_runtime(Settings(data_dir=directory), Metrics()) as service:
        clouds = [
            CloudInput(blob.sha256, blob.size)
            for blob in map(service.blobs.put, ([source], [target]))
        ]
        while not service.workers.is_ready:
            await asyncio.sleep(0.05)
        started = time.perf_counter()
        for seed in range(JOBS_WITHOUT_HTTP):
            service.submit(_job(*clouds, seed=seed))
        while service.jobs.count("succeeded") < JOBS_WITHOUT_HTTP:
            await asyncio.sleep(0.05)
        return JOBS_WITHOUT_HTTP / (time.perf_counter() - started)


def _job(source: CloudInput, target: CloudInput, *, seed: int) -> JobRow:
    defaults = {
        name: getattr(RegistrationOptions(), name) for name in RegistrationOptions.__slots__
    }
    options = defaults | {"seed": seed}
    return JobRow(
        id=str(uuid4()),
        tenant=DEFAULT_TENANT,
        source=source,
        target=target,
        options=options,
        created_at=time.time(),
    )


def _dispatch(server: Server) -> dict[str, Any]:
    """Measure the milliseconds from accepting a small job to the first message of its child."""
    cloud = np.random.default_rng(0).normal(size=(50, 3)) * (3, 2, 1)
    file = _npy(cloud)
    times = []
    for seed in range(DISPATCHES):
        job = server.submit(file, file, wait=30, options=f'{{"seed": {seed}}}').json()
        text = server.client.get(f"/v1/registrations/{job['id']}/events").text
        events = [json.loads(line[6:]) for line in text.splitlines() if line.startswith("data: ")]
        began = next(event for event in events if event["stage"] == "decode")
        times.append(_seconds(began["at"]) - _seconds(events[0]["at"]))
    return {name: 1000 * value for name, value in _spread(times).items() if name != "count"}


def _cancel(server: Server) -> dict[str, Any]:
    """Measure the milliseconds from canceling a job in native code to the end of its process."""
    clouds = slow_pair()
    times = []
    for _ in range(CANCELS):
        job = server.submit(*clouds, options=SLOW).json()
        (worker,) = until(lambda: [w for w in workers(server) if sum(w.cpu_times()[:2]) > 0.5])
        started = time.perf_counter()
        server.client.delete(f"{PATH}/{job['id']}")
        worker.wait()
        times.append(time.perf_counter() - started)
    return {name: 1000 * value for name, value in _spread(times).items() if name != "count"}


def _seconds(moment: str) -> float:
    return np.datetime64(moment.rstrip("Z")).astype("datetime64[us]").astype(float) / 1e6


def _spread(times: list[float]) -> dict[str, float]:
    return {
        "count": len(times),
        "median": statistics.median(times),
        "p99": float(np.percentile(times, 99)),
    }


def _bunny() -> tuple[bytes, bytes]:
    target = read_points(DATA / "bunny_whole" / "bun_zipper.ply").points
    turned = target @ Rotation.from_euler("xyz", (10, 20, -15), degrees=True).as_matrix().T
    return _npy(turned), _npy(target)


def _npy(cloud: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, cloud.astype(np.float32))
    return buffer.getvalue()


def _form(source: bytes, target: bytes) -> tuple[bytes, bytes]:
    """Return the multipart body before and after the options."""
    head = b""
    for name, file in (("source", source), ("target", target)):
        disposition = f'form-data; name="{name}"; filename="{name}.npy"'
        head += (
            f"--{BOUNDARY}\r\nContent-Disposition: {disposition}\r\n\r\n".encode() + file + b"\r\n"
        )
    head += f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="options"\r\n\r\n'.encode()
    return head, f"\r\n--{BOUNDARY}--\r\n".encode()


LOAD = Experiment("load", "The service under load", run, table)
