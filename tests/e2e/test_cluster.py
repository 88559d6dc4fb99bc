"""Services that share a database and a bucket, and no directory: two for the API, one worker."""

from __future__ import annotations

import hashlib
import itertools
import json
import threading
import time
from collections.abc import Iterator

import httpx
import pytest

from tests.e2e.test_events import follow
from tests.factories.postgres import Postgres
from tests.factories.processes import workers
from tests.factories.s3 import S3Server
from tests.factories.scans import arms, as_npy
from tests.factories.server import CALL_S, Server, finished, registered, running_server, submit
from tests.factories.slow import SLOW, slow_pair
from tests.factories.tcp_proxy import Balancer, running_proxy
from tests.factories.waiting import until

CLOUD = as_npy(arms(1))
JOBS = "/v1/registrations"
API = ("serve", "--no-workers")
TUS = {"Tus-Resumable": "1.0.0"}


@pytest.fixture(scope="module")
def settings(postgres: Postgres, s3: S3Server) -> dict[str, object]:
    database = {"database_url": postgres.new_database(), "maintenance_interval_s": 1}
    times = {"shutdown_delay_s": 1, "lease_s": 5}
    sizes = {"workers": 1, "large_bytes": 3 * len(CLOUD)}
    store = {**s3.new_prefix(), "blob_public_endpoint": s3.endpoint}
    return {**database, **times, **sizes, **store}


@pytest.fixture(scope="module")
def first(
    settings: dict[str, object], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Server]:
    with running_server(tmp_path_factory.mktemp("first"), command=API, **settings) as running:
        yield running


@pytest.fixture(scope="module")
def second(
    settings: dict[str, object], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Server]:
    with running_server(tmp_path_factory.mktemp("second"), command=API, **settings) as running:
        yield running


@pytest.fixture(scope="module", autouse=True)
def worker(
    settings: dict[str, object], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Server]:
    command = ("worker", "--concurrency", "1", "--labels", "large,gpu")
    with running_server(tmp_path_factory.mktemp("worker"), command=command, **settings) as running:
        yield running


def test_what_one_has_another_answers(first: Server, second: Server) -> None:
    job = registered(first.client, CLOUD, CLOUD)
    path = f"{JOBS}/{job['id']}"
    assert second.client.get(path).json()["result"] == job["result"]
    pairs = second.client.get(f"{path}/inliers").json()
    assert pairs == first.client.get(f"{path}/inliers").json()
    aligned = second.client.get(f"{path}/aligned?format=npy")
    assert (aligned.status_code, aligned.content[:6]) == (200, b"\x93NUMPY")


def test_any_service_tells_of_all_workers(first: Server, worker: Server) -> None:
    capacity = first.client.get("/v1/capacity").json()
    assert (capacity["workers"], capacity["labels"]) == (1, {"gpu": 1, "large": 1})
    assert first.client.get("/readyz").json() == {"status": "ok", "warnings": []}
    assert worker.client.get("/metrics").status_code == 200
    assert worker.client.get(JOBS).status_code == 404


def test_cancel_ends_the_process_of_the_worker(
    first: Server, second: Server, worker: Server
) -> None:
    job = first.submit(*slow_pair(), options=SLOW).json()
    job_id, needed = job["id"], job["progress"]["needs_label"]
    assert needed == "large"
    until(lambda: workers(worker))
    assert second.client.delete(f"{JOBS}/{job_id}").json()["status"] == "cancelled"
    until(lambda: not workers(worker))


def test_events_of_a_worker_reach_any(first: Server, second: Server) -> None:
    options = json.dumps({"seed": 3})
    job = first.submit(CLOUD, CLOUD, options=options).json()
    events = list(follow(second.client, job["id"]))
    assert [events[0]["status"], events[-1]["status"]] == ["queued", "succeeded"]


def test_a_stored_cloud_is_used_by_any(first: Server, second: Server) -> None:
    first.client.put("/v1/clouds/door", content=CLOUD).raise_for_status()
    body = {"source": {"cloud": "door"}, "target": {"cloud": "door"}}
    for server in (first, second):
        answer = server.client.post(JOBS, json=body | {"options": {"seed": server.port}})
        assert finished(server.client, answer.json()["id"])["status"] == "succeeded"


def test_an_upload_in_pieces_becomes_a_cloud_of_all(first: Server, second: Server) -> None:
    length = {**TUS, "Upload-Length": str(len(CLOUD))}
    place = first.client.post("/v1/uploads", headers=length).headers["Location"]
    pieces = (first, 0, CLOUD[:1000]), (second, 1000, CLOUD[1000:])
    for server, offset, piece in pieces:
        headers = {**TUS, "Upload-Offset": str(offset)}
        headers["Content-Type"] = "application/offset+octet-stream"
        assert server.client.patch(place, content=piece, headers=headers).status_code == 204
    cloud = second.client.get(place.replace("uploads", "clouds")).json()
    assert cloud["size"] == len(CLOUD)


def test_a_file_goes_past_the_service(first: Server, second: Server) -> None:
    file = {"sha256": hashlib.sha256(CLOUD).hexdigest(), "size": len(CLOUD)}
    begun = first.client.post("/v1/clouds/presign", json=file)
    assert httpx.put(begun.json()["url"], content=CLOUD, trust_env=False).is_success
    cloud = second.client.post(begun.headers["Location"]).raise_for_status().json()
    fetched = first.client.post(f"/v1/clouds/{cloud['id']}/presign").json()
    assert httpx.get(fetched["url"], trust_env=False).content == CLOUD
    assert "X-Amz" not in first.log


def test_a_result_is_reused(first: Server, second: Server) -> None:
    options = json.dumps({"seed": 7})
    registered(first.client, CLOUD, CLOUD, options=options)
    assert second.submit(CLOUD, CLOUD, options=options).json()["cached"] is True


def test_when_a_worker_is_killed_nothing_is_lost(first: Server, worker: Server) -> None:
    """Last in this file: the lease of the attempt has to end first."""
    cloud = as_npy(arms(8, 30_000))
    job_id = first.submit(cloud, cloud).json()["id"]
    until(lambda: workers(worker))
    worker.kill()
    worker.start()
    ended = finished(first.client, job_id)
    assert (ended["status"], ended["attempt"]) == ("succeeded", 2)


def test_a_rolling_restart_fails_no_call(first: Server, second: Server) -> None:
    """Behind a proxy that sends calls to services that are ready."""
    answers: list[int] = []
    has_ended = threading.Event()

    def call(url: str) -> None:
        seeds = itertools.count(1000)
        while not has_ended.is_set():
            with httpx.Client(base_url=url, timeout=CALL_S, trust_env=False) as client:
                answers.append(client.get(JOBS).status_code)
            with httpx.Client(base_url=url, timeout=CALL_S, trust_env=False) as client:
                options = json.dumps({"seed": next(seeds)})
                answers.append(submit(client, CLOUD, CLOUD, options=options).status_code)
            time.sleep(0.2)

    with running_proxy(Balancer([first.url, second.url]).dial) as proxy:
        caller = threading.Thread(target=call, args=[f"http://127.0.0.1:{proxy.port}"])
        caller.start()
        for server in (first, second):
            until(lambda: len(answers) > 2)
            server.stop()
            server.start()
            answers_before = len(answers)
            until(lambda: len(answers) > answers_before + 2)  # noqa: B023
        has_ended.set()
        caller.join()
    assert set(answers) == {200, 202}
