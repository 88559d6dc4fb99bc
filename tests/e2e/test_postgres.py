"""The service on PostgreSQL: nothing is lost there either, and several services share the work."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.test_events import follow
from tests.factories.postgres import Postgres, running_postgres
from tests.factories.processes import workers
from tests.factories.receiver import Receiver, receiving
from tests.factories.scans import arms, as_npy
from tests.factories.server import Server, finished, running_server
from tests.factories.slow import SLOW, slow_pair
from tests.factories.waiting import until

CLOUD = as_npy(arms(1))
JOBS = "/v1/registrations"


@pytest.fixture(scope="module")
def receiver() -> Iterator[Receiver]:
    with receiving() as running:
        yield running


@pytest.fixture(scope="module")
def settings(postgres: Postgres, receiver: Receiver) -> dict[str, object]:
    hooks = {"webhook_hosts": "127.0.0.1", "webhook_secret": "ebb", "webhook_backoff_s": 0.1}
    hooks["private_networks"] = "127.0.0.0/8"
    database_url = postgres.new_database()
    return {**hooks, "database_url": database_url, "workers": 1, "maintenance_interval_s": 1}


@pytest.fixture(scope="module")
def server(
    settings: dict[str, object], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Server]:
    with running_server(tmp_path_factory.mktemp("postgres"), **settings) as running:
        yield running


@contextmanager
def beside(server: Server, settings: dict[str, object]) -> Iterator[Server]:
    """Another service on the same database and data directory."""
    second = Server(server.data_dir, **settings)
    second.start()
    try:
        yield second
    finally:
        second.client.close()
        second.stop()


def submit_numbered(server: Server, number: int) -> str:
    """A quick job that is like no other."""
    return str(server.submit(CLOUD, CLOUD, options=json.dumps({"seed": number})).json()["id"])


def status(server: Server, job_id: str) -> str:
    return str(server.client.get(f"{JOBS}/{job_id}").json()["status"])


def test_a_registration_from_its_submission_to_its_removal(server: Server) -> None:
    key = {"Idempotency-Key": "first"}
    labels = json.dumps({"part": "door"})
    job = server.submit(CLOUD, CLOUD, wait=60, headers=key, labels=labels).json()
    assert job["status"] == "succeeded"
    again = server.submit(CLOUD, CLOUD, headers=key, labels=labels).json()
    assert again["id"] == job["id"]
    assert server.submit(CLOUD, CLOUD).json()["cached"] is True
    assert server.submit(CLOUD, CLOUD, headers=key).status_code == 422
    listed = server.client.get(JOBS, params={"label": "part:door"}).json()["items"]
    assert [item["id"] for item in listed] == [job["id"]]
    assert [event["status"] for event in follow(server.client, job["id"])][-1] == "succeeded"
    assert server.client.delete(f"{JOBS}/{job['id']}").status_code == 204
    assert server.client.get(f"{JOBS}/{job['id']}").status_code == 404


def test_the_store_is_there_and_no_sqlite_file(server: Server) -> None:
    assert not list(server.data_dir.glob("*.sqlite3*"))


def test_text_that_cannot_be_stored_is_refused(server: Server) -> None:
    assert server.client.get(f"{JOBS}/a%00b").status_code == 422
    assert server.client.get(JOBS, params={"label": "part:\0"}).status_code == 422
    labels = json.dumps({"part": "\0"})
    assert server.submit(CLOUD, CLOUD, labels=labels).status_code == 422


def test_the_password_is_not_logged(server: Server, settings: dict[str, object]) -> None:
    assert str(settings["database_url"]) not in server.log


def test_cancel_ends_the_worker(server: Server) -> None:
    job_id = server.submit(*slow_pair(), options=SLOW).json()["id"]
    until(lambda: status(server, job_id) == "running" and workers(server))
    assert server.client.delete(f"{JOBS}/{job_id}").json()["status"] == "cancelled"
    until(lambda: not workers(server))
    until(lambda: not list((server.data_dir / "scratch").iterdir()))


def test_a_service_that_starts_takes_nothing_from_another(
    server: Server, settings: dict[str, object]
) -> None:
    """Before the file's jobs that go on by themselves: the only worker is the one of this job."""
    until(lambda: not workers(server))
    job_id = server.submit(*slow_pair(), options=SLOW).json()["id"]
    (worker,) = until(lambda: workers(server))
    with beside(server, settings) as second:
        job = second.client.get(f"{JOBS}/{job_id}").json()
        assert (job["status"], job["attempt"]) == ("running", 1)
        assert worker.is_running()
        assert list((server.data_dir / "scratch").iterdir())
        assert second.client.delete(f"{JOBS}/{job_id}").json()["status"] == "cancelled"
        worker.wait(timeout=60)
        assert status(server, job_id) == "cancelled"


def test_callbacks_come(server: Server, receiver: Receiver) -> None:
    receiver.refusals = 1
    job = server.submit(CLOUD, CLOUD, callback_url=receiver.url, options='{"seed": 9}').json()
    finished(server.client, job["id"])
    until(lambda: _delivery(server, job["id"])["status"] == "delivered")
    assert [item["status_code"] for item in _delivery(server, job["id"])["tries"]] == [503, 204]


def _delivery(server: Server, job_id: str) -> dict[str, Any]:
    (delivery,) = server.client.get(f"{JOBS}/{job_id}/deliveries").json()["items"]
    return dict(delivery)


@pytest.fixture(scope="module")
def interrupted(server: Server) -> list[str]:
    """A job that ran, and some that waited, when the service was killed; it is up again."""
    cloud = as_npy(arms(7, 200_000))
    running = server.submit(cloud, cloud).json()["id"]
    waiting = [submit_numbered(server, number) for number in range(10, 13)]
    until(lambda: workers(server))
    server.kill()
    server.start()
    return [running, *waiting]


def test_after_a_kill_what_waited_goes_on(server: Server, interrupted: list[str]) -> None:
    for job_id in interrupted[1:]:
        assert finished(server.client, job_id)["status"] == "succeeded"


def test_services_share_the_work(server: Server, settings: dict[str, object]) -> None:
    with beside(server, settings) as second:
        jobs: list[str] = []

        def both_have_worked() -> bool:
            jobs.append(submit_numbered(server, 20 + len(jobs)))
            return min(_registered(each) for each in (server, second)) > 0

        until(both_have_worked)
        for job_id in jobs:
            ended = finished(second.client, job_id)
            assert (ended["status"], ended["attempt"]) == ("succeeded", 1)


def _registered(server: Server) -> float:
    """Jobs that this very process has brought to an end."""
    for line in server.client.get("/metrics").text.splitlines():
        if line.startswith("mpe_confidence_count"):
            return float(line.split()[1])
    return 0.0


def test_it_goes_on_when_the_database_comes_back(postgres: Postgres, tmp_path: Path) -> None:
    with running_postgres(postgres.programs) as own:
        url = own.new_database()
        with running_server(tmp_path, database_url=url, maintenance_interval_s=1) as server:
            first = submit_numbered(server, 1)
            assert finished(server.client, first)["status"] == "succeeded"
            cloud = as_npy(arms(8, 100_000))
            running = server.submit(cloud, cloud).json()["id"]
            until(lambda: workers(server))
            own.stop()
            away = server.client.get(f"{JOBS}/{first}")
            assert away.status_code == 503
            assert away.json()["type"] == "urn:mpe:problem:not-ready"
            assert server.client.get("/livez").status_code == 200
            assert server.client.get("/readyz").status_code == 503
            own.start()
            until(lambda: server.client.get("/readyz").status_code == 200)
            assert status(server, first) == "succeeded"
            assert finished(server.client, submit_numbered(server, 2))["status"] == "succeeded"
            ended = finished(server.client, running)
            assert (ended["status"], ended["attempt"]) == ("succeeded", 1)


def test_it_stops_while_the_database_is_away(postgres: Postgres, tmp_path: Path) -> None:
    with running_postgres(postgres.programs) as own:
        settings = {"database_url": own.new_database(), "shutdown_grace_s": 0, "workers": 1}
        with running_server(tmp_path, **settings) as server:
            server.submit(*slow_pair(), options=SLOW)
            until(lambda: workers(server))
            own.stop()
            server.stop()
            own.start()


def test_after_a_kill_what_ran_is_run_again(server: Server, interrupted: list[str]) -> None:
    """Last in this file: the lease of the attempt has to end first."""
    ended = finished(server.client, interrupted[0])
    assert ended["status"] == "succeeded"
    assert ended["attempt"] >= 2  # more if a lease ends while the machine is busy
