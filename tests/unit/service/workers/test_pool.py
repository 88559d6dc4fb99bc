"""The pool works on what waits, and gives back what it must interrupt."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from service.clouds.inputs import CloudInput
from service.database.engine import Database, open_database
from service.jobs.model import JobRow
from service.jobs.queries import JobQueries
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.workers import pool as module
from service.workers.child import NoProcessError
from service.workers.pool import WorkerPool
from tests.factories.attempts import FakeChild
from tests.factories.jobs import TENANT, add, claim, open_transitions
from tests.factories.waiting import until

AWAY = CloudInput(url="http://there/cloud.ply")


class FakeSupervisor:
    """Works on a job until its child is killed, or fails as the test wants."""

    error: Exception | None = None
    failure: str | None = None

    def __init__(
        self,
        transitions: Any,
        blobs: Any,
        settings: Any,
        started: Callable[[JobRow, Any], None],
        fetched: Callable[[], None],
    ) -> None:
        self._transitions = transitions
        self._started = started
        self.spare = self

    def wait_until_ready(self, timeout_s: float) -> bool:
        if FakeSupervisor.failure is not None:
            raise NoProcessError(FakeSupervisor.failure)
        return True

    def close(self) -> None:
        pass

    def run_attempt(self, job: JobRow) -> None:
        killed = threading.Event()
        child = FakeChild()
        child.kill = killed.set  # type: ignore[method-assign]
        self._started(job, child)
        if FakeSupervisor.error is not None:
            error, FakeSupervisor.error = FakeSupervisor.error, None
            raise error
        assert killed.wait(30)


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    opened = open_database(f"sqlite:///{tmp_path / 'jobs.sqlite3'}")
    yield opened
    opened.close()


@pytest.fixture
def pool(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[WorkerPool]:
    monkeypatch.setattr(module, "AttemptSupervisor", FakeSupervisor)
    monkeypatch.setattr(module, "prepare_forkserver", lambda threads: None)
    monkeypatch.setattr(module, "POLL_INTERVAL_S", 0.01)
    settings = Settings(data_dir=tmp_path, workers=2, threads_per_worker=1)
    made = WorkerPool(open_transitions(database), BlobStore(tmp_path), settings)
    yield made
    made.stop()


def statuses(database: Database) -> list[int]:
    """Numbers of jobs that wait and that run."""
    jobs = JobQueries(database)
    return [jobs.count("queued"), jobs.count("running")]


def test_as_many_jobs_run_as_there_are_workers(database: Database, pool: WorkerPool) -> None:
    transitions = open_transitions(database)
    for _ in range(5):
        add(transitions)
    assert not pool.is_ready
    pool.start()
    until(lambda: statuses(database) == [3, 2])
    assert pool.is_ready


def test_urls_hold_no_worker(database: Database, pool: WorkerPool) -> None:
    transitions = open_transitions(database)
    for _ in range(9):
        add(transitions, source=AWAY)
    pool.start()
    until(lambda: statuses(database)[1] == 4)
    mine = add(transitions)
    until(lambda: (mine.id, "register") in pool._running)


def test_a_tenant_gets_no_more_fetchers_than_it_leaves_free(
    database: Database, pool: WorkerPool
) -> None:
    """Of eight the first three get two, the fourth one; one is left for whoever comes next."""
    transitions, jobs = open_transitions(database), JobQueries(database)
    for tenant in "abcd":
        for _ in range(9):
            add(transitions, source=AWAY, tenant=tenant)
    pool.start()
    until(lambda: statuses(database)[1] == 7)
    assert sorted(jobs.count("running", tenant) for tenant in "abcd") == [1, 2, 2, 2]
    add(transitions, source=AWAY, tenant="late")
    until(lambda: jobs.count("running", "late") == 1)
    assert statuses(database)[1] == 8


def test_threads_that_claim_at_once_give_a_tenant_no_more(
    database: Database, pool: WorkerPool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each claim takes long enough for all the others to look."""
    transitions = open_transitions(database)
    for _ in range(9):
        add(transitions, source=AWAY)
    claim_next = pool._transitions.claim

    def claim_slowly(*args: Any, **kwargs: Any) -> JobRow | None:
        pool._stopping.wait(0.02)
        return claim_next(*args, **kwargs)

    monkeypatch.setattr(pool._transitions, "claim", claim_slowly)
    pool.start()
    until(lambda: statuses(database)[1] >= 4)
    pool._stopping.wait(0.2)
    assert statuses(database)[1] == 4


def test_a_stop_gives_back_what_runs_and_loses_no_attempt(
    database: Database, pool: WorkerPool
) -> None:
    job = add(open_transitions(database))
    pool.start()
    until(lambda: statuses(database) == [0, 1])
    pool.stop()
    assert statuses(database) == [1, 0]
    assert (pool.is_stopping, pool.is_stopped, pool.is_ready) == (True, True, False)
    again = JobQueries(database).get(TENANT, job.id)
    assert again is not None
    assert (again.attempt, again.lost_attempts) == (1, 0)


def test_a_killed_job_frees_its_worker(database: Database, pool: WorkerPool) -> None:
    transitions = open_transitions(database)
    job = add(transitions)
    pool.start()
    until(lambda: statuses(database) == [0, 1])
    until(lambda: (job.id, "register") in pool._running)
    transitions.cancel(job.id)
    pool.kill(job.id)
    pool.kill("unknown")
    until(lambda: pool._running == {})


def test_an_unexpected_error_ends_no_worker(
    database: Database, pool: WorkerPool, caplog: pytest.LogCaptureFixture
) -> None:
    FakeSupervisor.error = ZeroDivisionError()
    transitions = open_transitions(database)
    add(transitions)
    pool.start()
    until(lambda: "ZeroDivisionError" in caplog.text)
    for _ in range(2):
        add(transitions)
    pool.notify("register")
    until(lambda: statuses(database) == [0, 3])


def test_what_a_killed_service_left_is_taken_up(database: Database, pool: WorkerPool) -> None:
    transitions = open_transitions(database)
    add(transitions)
    left = claim(transitions)
    pool.start()
    until(lambda: pool._running.get((left.id, "register"), (left,))[0].attempt == 2)


def test_workers_that_cannot_start_say_why_and_claim_nothing(
    database: Database,
    pool: WorkerPool,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    add(open_transitions(database))
    monkeypatch.setattr(FakeSupervisor, "failure", "a library is missing")
    pool.start()
    until(lambda: caplog.text.count("a library is missing") == 2)
    assert (pool.is_ready, pool.failure) == (False, "a library is missing")
    assert statuses(database) == [1, 0]
    monkeypatch.setattr(FakeSupervisor, "failure", None)
    until(lambda: statuses(database) == [0, 1])
    assert (pool.is_ready, pool.failure) == (True, None)
    assert caplog.text.count("a library is missing") == 2


def test_an_attempt_that_hangs_does_not_keep_the_service_from_its_end(
    database: Database, pool: WorkerPool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It waits for a store of the files that does not answer; its job runs elsewhere."""
    monkeypatch.setattr(module, "STOP_S", 0.05)
    goes_on = threading.Event()
    run = FakeSupervisor.run_attempt

    def hang(supervisor: FakeSupervisor, job: JobRow) -> None:
        run(supervisor, job)
        assert goes_on.wait(20)

    monkeypatch.setattr(FakeSupervisor, "run_attempt", hang)
    add(open_transitions(database))
    pool.start()
    until(lambda: statuses(database) == [0, 1])
    pool.stop()
    assert pool.is_stopped
    assert statuses(database) == [1, 0]
    goes_on.set()
