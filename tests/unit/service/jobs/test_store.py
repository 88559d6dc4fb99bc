"""The job store is the truth: who may change a row, and what happens after a crash."""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from uuid import uuid4

import pytest
from sqlalchemy import update

from service.clouds.inputs import CloudInput
from service.database.engine import Database
from service.database.tables import jobs
from service.jobs.accept import Idempotency
from service.jobs.listing import Filter
from service.jobs.model import JobRow, Outcome, Retention
from service.jobs.retention import drop_expired, needed_blobs
from service.jobs.store import MAX_LOST_ATTEMPTS, JobStore
from service.problems import IdempotencyMismatchError, QueueFullError

CLOUD = CloudInput(sha256="ab", size=1)
OUTCOME = Outcome("result", "inliers", 100, 0.9, CLOUD, CLOUD, {"search_s": 1.0}, ["odd"])
LEASE_S = 30.0


@pytest.fixture
def database(url: str) -> Iterator[Database]:
    opened = Database(url)
    yield opened
    opened.close()


def open_store(database: Database, *, queue_limit: int = 100) -> JobStore:
    retention = Retention(result_s=60, job_s=120)
    return JobStore(database, queue_limit=queue_limit, retention=retention)


@pytest.fixture
def store(database: Database) -> JobStore:
    return open_store(database)


def new_job(**values: Any) -> JobRow:
    given = {"options": {"seed": 1}, "created_at": time.time(), "tenant": "lab"} | values
    return JobRow(id=str(uuid4()), source=CLOUD, target=CLOUD, **given)


def add(store: JobStore, **values: Any) -> JobRow:
    return store.add(new_job(**values))


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
    assert store.succeed(job, OUTCOME, None)
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
    assert not store.succeed(first, OUTCOME, None)
    assert not store.progress(first, "search", 0.9)
    assert not store.fail(first, {"detail": "late"}, {})
    assert not store.heartbeat(first, lease_s=LEASE_S)
    assert store.get(second.id) == second
    assert store.succeed(second, OUTCOME, None)


def test_a_cancelled_job_stays_cancelled(store: JobStore) -> None:
    add(store)
    job = claimed(store)
    assert store.cancel(job.id)
    assert not store.succeed(job, OUTCOME, None)
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
    database = Database(url)
    reopened = open_store(database)
    assert reopened.lose_all("killed") == 1
    assert [claimed(reopened).id for _ in range(2)] == [running.id, waiting.id]
    database.close()


def test_queue_is_bounded(database: Database) -> None:
    store = open_store(database, queue_limit=2)
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
        add(store, created_at=moment)
    seen: list[str] = []
    page = store.page(limit=3, only=Filter("lab"))
    while page:
        seen += [job.id for job in page]
        page = store.page(limit=3, only=Filter("lab"), before=(page[-1].created_at, page[-1].id))
    assert len(seen) == len(set(seen)) == 7


def test_list_is_filtered(store: JobStore) -> None:
    start = time.time()
    add(store, labels={"part": "door"})
    wanted = add(store, labels={"part": "wing", "shift": "2"})
    claimed(store)
    assert [job.id for job in store.page(limit=9, only=Filter("lab", status="queued"))] == [
        wanted.id
    ]
    assert [job.id for job in store.page(limit=9, only=Filter("lab", label=("part", "wing")))] == [
        wanted.id
    ]
    assert store.page(limit=9, only=Filter("lab", label=("part", "roof"))) == []
    assert len(store.page(limit=9, only=Filter("lab", created_after=start))) == 2
    assert store.page(limit=9, only=Filter("lab", created_before=start)) == []


def test_highest_priority_goes_first(store: JobStore) -> None:
    for priority in (0, 5, -5, 5):
        add(store, priority=priority)
    assert [claimed(store).priority for _ in range(4)] == [5, 5, 0, -5]


def test_a_waiting_job_fails_at_its_deadline(store: JobStore) -> None:
    late, early = add(store, deadline_at=time.time() - 1), add(store, deadline_at=time.time() + 60)
    assert store.miss_deadlines() == [late.id]
    row = store.get(late.id)
    assert row is not None
    assert row.error is not None
    assert row.error["type"].endswith("deadline-passed")
    assert claimed(store).id == early.id


def test_expired_leases_are_lost(store: JobStore) -> None:
    add(store)
    job = claimed(store)
    assert store.lose_all("lease", lease_before=time.time()) == 0
    assert store.lose_all("lease", lease_before=time.time() + 2 * LEASE_S) == 1
    assert claimed(store).attempt == job.attempt + 1


def test_same_key_gives_the_same_job(store: JobStore) -> None:
    first = store.add(new_job(), Idempotency("k", "request"))
    assert store.add(new_job(), Idempotency("k", "request")) == first
    assert store.add(new_job(), Idempotency("other", "request")).id != first.id
    with pytest.raises(IdempotencyMismatchError):
        store.add(new_job(), Idempotency("k", "another request"))


def test_a_key_is_free_again_when_its_job_is_removed(store: JobStore) -> None:
    first = store.add(new_job(), Idempotency("k", "request"))
    store.cancel(first.id)
    store.remove(first.id)
    assert store.add(new_job(), Idempotency("k", "another request")).id != first.id


def test_same_work_is_done_once(store: JobStore) -> None:
    add(store, work_key="w")
    assert add(store, work_key="w").status == "queued"
    assert store.succeed(claimed(store), OUTCOME, "w")
    again = add(store, work_key="w")
    assert (again.status, again.cached, again.result_sha256) == ("succeeded", True, "result")
    assert store.get(again.id) == again
    assert add(store, work_key="v").status == "queued"


def change(database: Database, **values: Any) -> None:
    """Of the jobs that have ended."""
    with database.write() as connection:
        ended = jobs.c.finished_at.is_not(None)
        connection.execute(update(jobs).where(ended).values(**values))


def test_results_expire_before_jobs(database: Database) -> None:
    store = open_store(database)
    done, waiting = add(store, work_key="w"), add(store)
    store.succeed(claimed(store), OUTCOME, "w")
    drop_expired(database)
    assert needed_blobs(database) == {"ab", "result", "inliers"}
    change(database, result_expires_at=time.time() - 1)
    assert add(store, work_key="w").status == "queued"
    drop_expired(database)
    row = store.get(done.id)
    assert row is not None
    assert (row.status, row.result_sha256) == ("succeeded", None)
    change(database, expires_at=time.time() - 1)
    drop_expired(database)
    assert store.get(done.id) is None
    assert store.get(waiting.id) == waiting
    assert needed_blobs(database) == {"ab"}


def test_every_change_is_an_event(store: JobStore) -> None:
    job = add(store)
    attempt = claimed(store)
    store.progress(attempt, "search", 0.5)
    store.succeed(attempt, OUTCOME, None)
    seen = [(e.number, e.status, e.stage) for e in store.events(job.id, after=0)]
    assert seen == [
        (1, "queued", "queued"),
        (2, "running", "queued"),
        (3, "running", "search"),
        (4, "succeeded", "finished"),
    ]
    assert [event.number for event in store.events(job.id, after=2)] == [3, 4]
    store.remove(job.id)
    assert store.events(job.id, after=0) == []
