"""Who may change a job, what happens after a crash, and who is told."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from service.database.engine import Database, open_database
from service.jobs import transitions as transitions_module
from service.jobs.claim_order import MAX_PAUSE_S
from service.jobs.model import JobRow
from service.jobs.queries import JobQueries
from service.jobs.transitions import MAX_INTERRUPTIONS, MAX_LOST_ATTEMPTS, JobTransitions
from tests.factories.clock_of_tests import pass_time
from tests.factories.jobs import LEASE_S, OUTCOME, TENANT, add, claim, open_transitions


def read(queries: JobQueries, job: JobRow) -> JobRow:
    """The job as it is now."""
    row = queries.get_unscoped(job.id)
    assert row is not None
    return row


def test_row_comes_back_as_it_was(transitions: JobTransitions, queries: JobQueries) -> None:
    job = add(transitions)
    assert read(queries, job) == job


def test_oldest_job_is_claimed_first_and_once(transitions: JobTransitions) -> None:
    jobs = [add(transitions) for _ in range(20)]
    assert claim(transitions).id == jobs[0].id
    with ThreadPoolExecutor(8) as threads:
        taken = list(threads.map(lambda _: transitions.claim(lease_s=LEASE_S), range(30)))
    ids = [job.id for job in taken if job is not None]
    assert sorted(ids) == sorted(job.id for job in jobs[1:])


def test_highest_priority_of_a_tenant_goes_first(transitions: JobTransitions) -> None:
    for priority in (0, 5, -5, 5):
        add(transitions, priority=priority)
    assert [claim(transitions).priority for _ in range(4)] == [5, 5, 0, -5]


def test_success_is_committed_with_its_timing(
    transitions: JobTransitions, queries: JobQueries
) -> None:
    add(transitions)
    job = claim(transitions)
    assert transitions.record_progress(job, "search", 0.5)
    assert transitions.succeed(job, OUTCOME, None)
    row = read(queries, job)
    assert (row.status, row.attempt, row.result_sha256) == ("succeeded", 1, "result")
    assert row.warnings == ["odd"]
    assert row.timing["search_s"] == 1.0
    assert row.timing["total_s"] >= row.timing["queued_s"] >= 0


def test_an_attempt_that_lost_its_job_changes_nothing(
    transitions: JobTransitions, queries: JobQueries
) -> None:
    add(transitions)
    first = claim(transitions)
    assert transitions.record_lost_attempt(first, "killed")
    second = claim(transitions)
    assert second.attempt == 2
    assert not transitions.is_current(first)
    assert not transitions.succeed(first, OUTCOME, None)
    assert not transitions.record_progress(first, "search", 0.9)
    assert not transitions.record_fetched(first)
    assert not transitions.fail(first, {"detail": "late"}, {})
    assert not transitions.requeue(first)
    assert not transitions.record_lost_attempt(first, "again")
    assert not transitions.extend_lease(first, lease_s=LEASE_S)
    assert read(queries, second) == second
    assert transitions.is_current(second)
    assert transitions.succeed(second, OUTCOME, None)


def test_a_cancelled_job_stays_cancelled(transitions: JobTransitions, queries: JobQueries) -> None:
    add(transitions)
    job = claim(transitions)
    assert transitions.cancel(job.id)
    assert not transitions.succeed(job, OUTCOME, None)
    assert not transitions.cancel(job.id)
    assert read(queries, job).status == "cancelled"
    assert transitions.remove(job.id)
    assert queries.get_unscoped(job.id) is None


def test_a_queued_job_cannot_be_removed(transitions: JobTransitions) -> None:
    assert not transitions.remove(add(transitions).id)


def test_attempts_without_an_answer_are_bounded(
    transitions: JobTransitions, queries: JobQueries
) -> None:
    add(transitions)
    for _ in range(MAX_LOST_ATTEMPTS):
        job = claim(transitions)
        transitions.record_lost_attempt(job, "SIGKILL")
    assert transitions.claim(lease_s=LEASE_S) is None
    error = read(queries, job).error
    assert error is not None
    assert "SIGKILL" in error["detail"]


def test_a_requeued_job_has_lost_nothing(transitions: JobTransitions) -> None:
    add(transitions)
    for _ in range(MAX_LOST_ATTEMPTS + 1):
        assert transitions.requeue(claim(transitions))
    assert claim(transitions).lost_attempts == 0


def test_after_a_crash_running_jobs_are_queued_again(transitions: JobTransitions, url: str) -> None:
    running, waiting = add(transitions), add(transitions)
    claim(transitions, lease_s=-1)
    database = open_database(url)
    reopened = open_transitions(database)
    assert reopened.requeue_orphans() == 1
    assert [claim(reopened).id for _ in range(2)] == [running.id, waiting.id]
    database.close()


def test_attempts_whose_lease_has_ended_are_interrupted(transitions: JobTransitions) -> None:
    add(transitions)
    job = claim(transitions)
    assert transitions.expire_leases() == 0
    assert transitions.extend_lease(job, lease_s=-1)
    assert transitions.expire_leases() == 1
    again = claim(transitions)
    assert (again.attempt, again.lost_attempts, again.interruptions) == (job.attempt + 1, 0, 1)


def test_a_service_that_was_suspended_keeps_the_attempts_that_it_supervises(
    transitions: JobTransitions,
) -> None:
    add(transitions)
    job = claim(transitions, lease_s=-1)
    assert transitions.expire_leases({job.id}) == 0
    assert transitions.is_current(job)
    assert transitions.extend_lease(job, lease_s=LEASE_S)


def test_services_that_die_are_counted_apart_from_lost_attempts(
    transitions: JobTransitions, queries: JobQueries, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transitions_module, "_pause_after", lambda interruptions: 0.0)
    added = add(transitions)
    for number in range(1, MAX_INTERRUPTIONS):
        claim(transitions, lease_s=-1)
        assert transitions.requeue_orphans() == 1
        row = read(queries, added)
        assert (row.status, row.interruptions, row.lost_attempts) == ("queued", number, 0)
    claim(transitions, lease_s=-1)
    transitions.requeue_orphans()
    error = read(queries, added).error
    assert error is not None
    assert error["detail"].startswith("20 attempts were interrupted; the last: the service was")


def test_the_pauses_after_interruptions_grow_up_to_a_bound() -> None:
    pauses = [transitions_module._pause_after(number) for number in range(1, MAX_INTERRUPTIONS)]
    assert pauses == sorted(pauses)
    assert (pauses[0], pauses[3], pauses[-1]) == (0.0, 2.0, MAX_PAUSE_S)


def test_a_job_that_pauses_lets_others_go_first(
    transitions: JobTransitions, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transitions_module, "_pause_after", lambda interruptions: 60.0)
    first, second = add(transitions), add(transitions)
    assert transitions.interrupt(claim(transitions), "the disk is full")
    assert claim(transitions).id == second.id
    assert transitions.claim(lease_s=LEASE_S) is None
    pass_time(database, 61)
    assert claim(transitions).id == first.id


def test_a_pause_beyond_the_bound_is_a_clock_that_was_set_back(
    transitions: JobTransitions, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transitions_module, "_pause_after", lambda interruptions: MAX_PAUSE_S)
    first = add(transitions)
    assert transitions.interrupt(claim(transitions), "the disk is full")
    pass_time(database, -3600)
    assert claim(transitions).id == first.id


def test_a_queued_job_fails_at_its_deadline(
    transitions: JobTransitions, queries: JobQueries
) -> None:
    now = time.time()
    late, early = add(transitions, deadline_at=now - 1), add(transitions, deadline_at=now + 60)
    assert transitions.fail_overdue() == 1
    error = read(queries, late).error
    assert error is not None
    assert error["type"].endswith("deadline-passed")
    assert claim(transitions).id == early.id


def test_every_change_is_an_event(transitions: JobTransitions, queries: JobQueries) -> None:
    job = add(transitions)
    attempt = claim(transitions)
    transitions.record_progress(attempt, "search", 0.5)
    transitions.succeed(attempt, OUTCOME, None)
    events = queries.events(TENANT, job.id, after=0)
    assert [(event.number, event.status, event.stage) for event in events] == [
        (1, "queued", "queued"),
        (2, "running", "queued"),
        (3, "running", "search"),
        (4, "succeeded", "finished"),
    ]
    assert [event.number for event in queries.events(TENANT, job.id, after=2)] == [3, 4]
    transitions.remove(job.id)
    assert queries.events(TENANT, job.id, after=0) == []


class Recorder:
    """A listener that remembers what it was told, and what could be read at that moment."""

    def __init__(self, queries: JobQueries) -> None:
        self.queries = queries
        self.calls: list[tuple[str, str]] = []

    def changed(self, job_id: str) -> None:
        row = self.queries.get_unscoped(job_id)
        assert row is not None
        self.calls.append(("changed", row.status))

    def ended(self, job: JobRow) -> None:
        assert self.queries.get_unscoped(job.id) == job
        self.calls.append(("ended", job.status))


class Broken:
    """A listener that always fails."""

    def changed(self, job_id: str) -> None:
        raise RuntimeError(job_id)

    def ended(self, job: JobRow) -> None:
        raise RuntimeError(job.id)


def test_listeners_are_told_of_each_change_once_it_can_be_read(
    database: Database, queries: JobQueries
) -> None:
    recorder = Recorder(queries)
    transitions = open_transitions(database, recorder)
    add(transitions)
    transitions.requeue(claim(transitions))
    job = claim(transitions)
    transitions.record_progress(job, "search", 0.5)
    transitions.succeed(job, OUTCOME, None)
    assert recorder.calls == [
        ("changed", "running"),
        ("changed", "queued"),
        ("changed", "running"),
        ("changed", "running"),
        ("ended", "succeeded"),
    ]


def test_listeners_are_told_of_every_way_to_end(database: Database, queries: JobQueries) -> None:
    recorder = Recorder(queries)
    transitions = open_transitions(database, recorder)
    transitions.cancel(add(transitions).id)
    add(transitions, deadline_at=time.time() - 1)
    transitions.fail_overdue()
    add(transitions)
    transitions.fail(claim(transitions), {"detail": "x"}, {})
    ends = [status for kind, status in recorder.calls if kind == "ended"]
    assert ends == ["cancelled", "failed", "failed"]


def test_listeners_are_not_told_of_what_did_not_count(
    database: Database, queries: JobQueries
) -> None:
    transitions = open_transitions(database)
    add(transitions)
    job = claim(transitions)
    transitions.cancel(job.id)
    recorder = Recorder(queries)
    late = open_transitions(database, recorder)
    assert not late.succeed(job, OUTCOME, None)
    assert not late.record_progress(job, "search", 0.5)
    assert not late.cancel(job.id)
    assert recorder.calls == []


def test_a_listener_that_fails_harms_nobody(
    database: Database, queries: JobQueries, caplog: pytest.LogCaptureFixture
) -> None:
    recorder = Recorder(queries)
    transitions = open_transitions(database, Broken(), recorder)
    add(transitions)
    assert transitions.succeed(claim(transitions), OUTCOME, None)
    assert recorder.calls == [("changed", "running"), ("ended", "succeeded")]
    assert "a listener failed" in caplog.text
