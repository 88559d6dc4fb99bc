"""Services whose clocks do not agree share a database: its clock is the one that counts."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing

import pytest

from service.database.engine import Database, open_database
from service.jobs.queries import JobQueries
from service.jobs.retention import drop_expired
from service.jobs.transitions import JobTransitions
from service.jobs.worker_slots import WorkerSlots
from service.webhooks.outbox import Outbox
from tests.factories.jobs import OUTCOME, TENANT, add, claim, open_transitions
from tests.factories.postgres import Postgres

SKEW_S = 3600.0


@pytest.fixture
def shared(postgres: Postgres) -> Iterator[Database]:
    with closing(open_database(postgres.new_database())) as database:
        yield database


each_skew = pytest.mark.parametrize("skew_s", [-SKEW_S, SKEW_S], ids=["slow", "fast"])


def set_clock(monkeypatch: pytest.MonkeyPatch, skew_s: float) -> None:
    real = time.time
    monkeypatch.setattr(time, "time", lambda: real() + skew_s)


@pytest.fixture
def transitions(shared: Database) -> JobTransitions:
    return open_transitions(shared)


@each_skew
def test_a_skewed_service_takes_nothing_from_others(
    transitions: JobTransitions,
    shared: Database,
    skew_s: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    queries, slots = JobQueries(shared), WorkerSlots(shared, 2)
    held = add(transitions)
    attempt = claim(transitions)
    late = add(transitions, deadline_at=queries.present() + 60)
    slots.announce()
    set_clock(monkeypatch, skew_s)
    assert transitions.expire_leases() == transitions.requeue_orphans() == 0
    assert transitions.fail_overdue() == 0
    assert transitions.extend_lease(attempt, lease_s=30)
    assert slots.count() == 2
    assert claim(transitions).id == late.id
    assert transitions.is_current(attempt)
    assert attempt.id == held.id


@each_skew
def test_what_a_skewed_service_writes_has_the_times_of_the_others(
    transitions: JobTransitions,
    shared: Database,
    skew_s: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    set_clock(monkeypatch, skew_s)
    queries = JobQueries(shared)
    began_at = queries.present()
    add(transitions, created_at=began_at, callback_url="http://there/hook")
    assert transitions.succeed(claim(transitions), OUTCOME, None)
    drop_expired(shared)
    (job,) = queries.page(TENANT, limit=2)
    ended_at = queries.present()
    for moment in (job.started_at, job.finished_at):
        assert moment is not None
        assert began_at <= moment <= ended_at
    assert job.result_sha256 == OUTCOME.result_sha256
    assert all(0 <= seconds <= ended_at - began_at for seconds in (job.timing["total_s"],))
    assert Outbox(shared).claim(8) is not None
