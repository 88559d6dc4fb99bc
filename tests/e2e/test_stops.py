"""What happens to jobs when the service stops, well or badly."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest

from tests.factories.processes import forkserver, workers
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, finished, running_server
from tests.factories.slow import SLOW, slow_pair
from tests.factories.waiting import until

CLOUD = as_npy(arms(1))


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Each test leaves it running, with nothing to do."""
    directory = tmp_path_factory.mktemp("stops")
    with running_server(directory, workers=1, shutdown_grace_s=60) as running:
        yield running


def stage(server: Server, job: dict[str, Any]) -> str:
    return str(server.client.get(f"/v1/registrations/{job['id']}").json()["progress"]["stage"])


def test_killed_with_jobs_running_and_waiting(server: Server) -> None:
    running = server.submit(*slow_pair(), options=SLOW).json()
    waiting = [
        server.submit(CLOUD, CLOUD, options=f'{{"seed": {seed}}}').json() for seed in range(3)
    ]
    family = [forkserver(server), *until(lambda: workers(server))]
    server.kill()
    _, alive = psutil.wait_procs(family, timeout=60)
    assert not alive, "a process outlived the service"
    server.start()
    again = server.client.get(f"/v1/registrations/{running['id']}").json()
    assert again["status"] in ("queued", "running")
    server.client.delete(f"/v1/registrations/{running['id']}")
    for job in waiting:
        assert finished(server.client, job["id"])["status"] == "succeeded"


def test_terminated_while_busy(server: Server) -> None:
    """It answers but takes nothing on; told again, it hands the job back; a start takes it up."""
    job = server.submit(*slow_pair(), options=SLOW).json()
    until(lambda: workers(server))
    server.terminate()
    until(lambda: server.client.get("/readyz").status_code == 503)
    assert server.client.get("/livez").status_code == 200
    refused = server.submit(CLOUD, CLOUD)
    assert refused.status_code == 503
    assert refused.json()["type"] == "urn:mpe:problem:not-ready"
    server.stop()
    server.start()
    until(lambda: workers(server))
    again = server.client.get(f"/v1/registrations/{job['id']}").json()
    assert (again["status"], again["attempt"]) == ("running", 2)
    server.client.delete(f"/v1/registrations/{job['id']}")


def test_terminated_with_a_job_that_ends_in_time(server: Server) -> None:
    cloud = as_npy(arms(6, 5_000))
    job = server.submit(cloud, cloud).json()
    until(lambda: stage(server, job) != "queued")
    server.stop()
    server.start()
    ended = finished(server.client, job["id"])
    assert (ended["status"], ended["attempt"]) == ("succeeded", 1)


def test_a_data_directory_has_one_service(server: Server) -> None:
    second = Server(server.data_dir)
    with pytest.raises(AssertionError, match="another service already uses"):
        second.start()
    assert server.client.get("/readyz").status_code == 200
    second.client.close()


def test_a_wait_at_the_stop_is_answered(tmp_path: Path) -> None:
    """What does not end within the grace is handed back, and that is told."""
    with running_server(tmp_path, workers=1, shutdown_grace_s=5) as server:
        _wait_at_the_stop(server)


def _wait_at_the_stop(server: Server) -> None:
    job = server.submit(*slow_pair(), options=SLOW).json()
    waited: list[httpx.Response] = []
    url, patience = f"/v1/registrations/{job['id']}", {"Prefer": "wait=60"}
    waiter = threading.Thread(
        target=lambda: waited.append(server.client.get(url, headers=patience))
    )
    waiter.start()
    server.stop()  # it answers during the grace, so the wait may also begin then
    waiter.join()
    assert waited[0].json()["status"] == "queued"
