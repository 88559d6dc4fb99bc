"""The job store is the truth: who may change a row, and what happens after a crash."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from uuid import uuid4

import pytest
from sqlalchemy import update

from service.jobs.database import open_database
from service.jobs.job import CloudInput, JobRow, Outcome
from service.jobs.store import MAX_LOST_ATTEMPTS, JobStore
from service.jobs.tables import schema_version
from service.problems import QueueFullError

CLOUD = CloudInput(sha256="ab", size=1)
OUTCOME = Outcome("result", "inliers", CLOUD, CLOUD, {"search_s": 1.0}, ["odd"])
LEASE_S = 30.0


@pytest.fixture
def url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path / 'jobs.sqlite3'}"


@pytest.fixture
def store(url: str) -> JobStore:
    return JobStore(url, queue_limit=100)


def new_job() -> JobRow:
    return JobRow(
        id=str(uuid4()), source=CLOUD, target=CLOUD, options={"seed": 1}, created_at=time.time()
    )


def add(store: JobStore) -> JobRow:
    job = new_job()
    store.add(job)
    return job


def claimed(store: JobStore) -> JobRow:
    job = store.claim(lease_s=LEASE_S)
    assert job is not None
    return job


def test_row_comes_back_as_it_was(store: JobStore) -> None:
    job = add(store)
    assert store.get(job.id) == job
    assert store.get("nobody") is None


def test_oldest_job_is_claimed_first_and_once(store: JobStore) -> None:
    jobs = [add(store) for _ in range(20)]
    assert claimed(store).id == jobs[0].id
    with ThreadPoolExecutor(8) as threads:
        taken = list(threads.map(lambda _: store.claim(lease_s=LEASE_S), range(30)))
    ids = [job.id for job in taken if job is not None]
    assert sorted(ids) == sorted(job.id for job in jobs[1:])


def test_success_is_committed_with_its_timing(store: JobStore) -> None:
    add(store)
    job = claimed(store)
    assert store.progress(job, "search", 0.5)
    assert store.succeed(job, OUTCOME)
    row = store.get(job.id)
    assert row is not None
    assert (row.status, row.attempt, row.result_sha256) == ("succeeded", 1, "result")
    assert row.warnings == ["odd"]
    assert row.timing["search_s"] == 1.0
    assert row.timing["total_s"] >= row.timing["queued_s"] >= 0


def test_an_attempt_that_lost_its_job_changes_nothing(store: JobStore) -> None:
    add(store)
    first = claimed(store)
    assert store.lose(first, "killed")
    second = claimed(store)
    assert second.attempt == 2
    assert not store.succeed(first, OUTCOME)
    assert not store.progress(first, "search", 0.9)
    assert not store.fail(first, {"detail": "late"}, {})
    assert not store.heartbeat(first, lease_s=LEASE_S)
    assert store.get(second.id) == second
    assert store.succeed(second, OUTCOME)


def test_a_cancelled_job_stays_cancelled(store: JobStore) -> None:
    add(store)
    job = claimed(store)
    assert store.cancel(job.id)
    assert not store.succeed(job, OUTCOME)
    assert not store.cancel(job.id)
    row = store.get(job.id)
    assert row is not None
    assert row.status == "cancelled"
    assert store.remove(job.id)
    assert store.get(job.id) is None


def test_a_waiting_job_cannot_be_removed(store: JobStore) -> None:
    assert not store.remove(add(store).id)


def test_attempts_without_an_answer_are_bounded(store: JobStore) -> None:
    add(store)
    for _ in range(MAX_LOST_ATTEMPTS):
        job = claimed(store)
        store.lose(job, "SIGKILL")
    assert store.claim(lease_s=LEASE_S) is None
    row = store.get(job.id)
    assert row is not None
    assert row.error is not None
    assert "SIGKILL" in row.error["detail"]


def test_a_job_handed_back_has_lost_nothing(store: JobStore) -> None:
    add(store)
    for _ in range(MAX_LOST_ATTEMPTS + 1):
        assert store.hand_back(claimed(store))
    assert claimed(store).lost_attempts == 0


def test_after_a_crash_running_jobs_wait_again(store: JobStore, url: str) -> None:
    running, waiting = add(store), add(store)
    claimed(store)
    reopened = JobStore(url, queue_limit=100)
    assert reopened.recover() == 1
    assert [claimed(reopened).id for _ in range(2)] == [running.id, waiting.id]


def test_queue_is_bounded(url: str) -> None:
    store = JobStore(url, queue_limit=2)
    add(store), add(store)
    with pytest.raises(QueueFullError) as caught:
        add(store)
    assert caught.value.members == {"queued": 2}
    assert int(caught.value.headers["Retry-After"]) > 0
    claimed(store)
    add(store)


def test_pages_cover_jobs_of_the_same_instant(store: JobStore) -> None:
    moment = time.time()
    for _ in range(7):
        store.add(
            JobRow(id=str(uuid4()), source=CLOUD, target=CLOUD, options={}, created_at=moment)
        )
    seen: list[str] = []
    page = store.page(limit=3, before=None)
    while page:
        seen += [job.id for job in page]
        page = store.page(limit=3, before=(page[-1].created_at, page[-1].id))
    assert len(seen) == len(set(seen)) == 7


def test_a_store_of_a_later_release_is_refused(store: JobStore, url: str) -> None:
    with open_database(url).begin() as connection:
        connection.execute(update(schema_version).values(version=99))
    with pytest.raises(RuntimeError, match="version 99"):
        JobStore(url, queue_limit=1)
