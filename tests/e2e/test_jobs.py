"""What a caller may say about a job, and what the service makes of it."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, finished, running_server, submit
from tests.factories.slow import SLOW, slow_pair
from tests.factories.waiting import until

CLOUD = as_npy(arms(1))


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Of this file alone: its registrations are counted."""
    with running_server(tmp_path_factory.mktemp("server")) as running:
        yield running


def register(server: Server, **fields: Any) -> dict[str, Any]:
    response = server.submit(CLOUD, CLOUD, wait=60, **fields)
    assert response.status_code == 200, response.text
    return dict(response.json())


def listed(server: Server, **parameters: str) -> list[str]:
    page = server.client.get("/v1/registrations", params=parameters).json()
    return [item["id"] for item in page["items"]]


def test_labels_come_back_and_are_searched_for(server: Server) -> None:
    first = register(server, labels='{"part": "door"}', options='{"seed": 101}')
    second = register(server, labels='{"part": "wing", "shift": "2"}', options='{"seed": 102}')
    assert second["labels"] == {"part": "wing", "shift": "2"}
    assert listed(server, label="part:wing") == [second["id"]]
    assert listed(server, label="part:door", status="succeeded") == [first["id"]]
    assert listed(server, label="part:door", status="failed") == []
    assert listed(server, label="part:door", created_after=second["created_at"]) == []
    assert listed(server, label="part:door", created_before=second["created_at"]) == [first["id"]]
    assert server.submit(CLOUD, CLOUD, labels='{"a b": "c"}').status_code == 422


def test_same_work_is_done_once(server: Server) -> None:
    first = register(server, options='{"seed": 7}')
    again = register(server, options='{"seed": 7}')
    other = register(server, options='{"seed": 8}')
    assert (first["cached"], again["cached"], other["cached"]) == (False, True, False)
    assert again["id"] != first["id"]
    assert again["result"] == first["result"]
    assert again["timing"]["search_s"] is None
    for job in (first, again):
        server.client.delete(f"/v1/registrations/{job['id']}")
    assert not register(server, options='{"seed": 7}')["cached"]


def test_same_key_gives_the_same_registration(server: Server) -> None:
    key = {"Idempotency-Key": "order-66"}
    first = register(server, headers=key, options='{"seed": 9}')
    again = register(server, headers=key, options='{"seed": 9}')
    assert again["id"] == first["id"]
    mismatch = server.submit(CLOUD, CLOUD, headers=key, options='{"seed": 10}')
    assert mismatch.status_code == 422
    assert mismatch.json()["type"] == "urn:mpe:problem:idempotency-mismatch"


def test_a_key_whose_first_request_is_under_way_is_refused(server: Server) -> None:
    key = {"Idempotency-Key": "slow-upload"}
    head = (
        "POST /v1/registrations HTTP/1.1\r\nHost: localhost\r\nIdempotency-Key: slow-upload\r\n"
        "Content-Type: multipart/form-data; boundary=x\r\nContent-Length: 12\r\n"
        "Expect: 100-continue\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", server.port)) as first:
        first.sendall(head.encode())
        assert first.recv(100).startswith(b"HTTP/1.1 100 ")  # it waits for the body
        second = server.submit(CLOUD, CLOUD, headers=key)
        assert second.status_code == 409
        assert second.json()["type"] == "urn:mpe:problem:idempotency-in-flight"
        first.sendall(b"--x\r\n--x--\r\n")
        assert first.recv(100).startswith(b"HTTP/1.1 400 ")
    assert server.submit(CLOUD, CLOUD, headers=key, wait=60).status_code == 200


def test_capacity_and_expiry_are_announced(server: Server) -> None:
    capacity = server.client.get("/v1/capacity").json()
    assert capacity["free"] + capacity["running"] == capacity["workers"] >= 1
    assert capacity["queued"] == 0
    job = register(server)
    assert job["finished_at"] < job["result_expires_at"] < job["expires_at"]


@pytest.fixture
def narrow(tmp_path: Path) -> Iterator[Server]:
    with running_server(tmp_path, workers=1, queue_limit=2) as server:
        yield server


def test_priority_deadline_and_a_full_queue(narrow: Server) -> None:
    blocker = narrow.submit(*slow_pair(), options=SLOW).json()
    until(lambda: narrow.client.get("/v1/capacity").json()["running"])
    low = narrow.submit(CLOUD, CLOUD, options='{"seed": 1}', priority="-1").json()
    high = narrow.submit(CLOUD, CLOUD, options='{"seed": 2}', priority="1").json()
    full = narrow.submit(CLOUD, CLOUD, options='{"seed": 3}')
    assert full.status_code == 429
    assert full.json()["queued"] == 2
    assert int(full.headers["Retry-After"]) > 0
    narrow.client.delete(f"/v1/registrations/{blocker['id']}")
    done = [finished(narrow.client, job["id"]) for job in (low, high)]
    assert done[1]["started_at"] < done[0]["started_at"]
    late = narrow.submit(*slow_pair(), options=SLOW, deadline_s="1", wait=60).json()
    assert late["status"] == "failed"
    assert late["error"]["type"] == "urn:mpe:problem:deadline-passed"
    assert narrow.submit(CLOUD, CLOUD, wait=60).json()["status"] == "succeeded"


@pytest.mark.parametrize("resource", ["disk", "memory"])
def test_too_little_disk_or_memory(tmp_path: Path, resource: str) -> None:
    short = {f"min_free_{resource}_bytes": 10**18}
    with running_server(tmp_path, ready=resource != "disk", **short) as server:
        response = server.submit(CLOUD, CLOUD)
        assert response.status_code == 503
        assert response.json()["type"] == "urn:mpe:problem:overloaded"
        assert resource in response.json()["detail"]
        assert int(response.headers["Retry-After"]) > 0
        assert server.client.get("/livez").status_code == 200
        is_ready = server.client.get("/readyz").status_code == 200
        assert is_ready == (resource != "disk")


def test_results_and_files_are_dropped_in_time(tmp_path: Path) -> None:
    soon = {"result_retention_s": 3, "blob_grace_s": 2, "maintenance_interval_s": 0.2}
    with running_server(tmp_path, **soon) as server:
        job = register(server)
        url = f"/v1/registrations/{job['id']}"
        expired = until(lambda: _with_status(server.client, f"{url}/inliers", 410))
        assert expired["type"] == "urn:mpe:problem:expired"
        assert server.client.get(url).json()["result"] is None
        until(lambda: not list((server.data_dir / "blobs").glob("*/*")))


def test_jobs_are_dropped_in_time(tmp_path: Path) -> None:
    soon = {"result_retention_s": 1, "job_retention_s": 1, "maintenance_interval_s": 0.2}
    with running_server(tmp_path, **soon) as server:
        job = server.submit(CLOUD, CLOUD).json()
        gone = until(lambda: _with_status(server.client, f"/v1/registrations/{job['id']}", 404))
        assert gone["type"] == "urn:mpe:problem:unknown-registration"


def _with_status(client: httpx.Client, url: str, status: int) -> Any:
    response = client.get(url)
    return response.json() if response.status_code == status else None


def test_clients_with_one_key_get_one_registration(server: Server) -> None:
    """At the same time; who comes while the first is read is told so, and asks again."""
    key = {"Idempotency-Key": "both"}

    def accepted() -> Any:
        response = submit(server.client, CLOUD, CLOUD, headers=key, options='{"seed": 55}')
        assert response.status_code in (200, 202, 409), response.text
        return response.json().get("id")

    with ThreadPoolExecutor(8) as clients:
        asked = [clients.submit(until, accepted) for _ in range(8)]
    assert len({one.result() for one in asked}) == 1
