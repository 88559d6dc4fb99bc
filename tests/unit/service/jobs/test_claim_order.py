"""Tenants take turns; priority orders the jobs of one tenant only."""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace

import pytest
from sqlalchemy import insert

from service.clouds.inputs import CloudInput
from service.database.engine import Database
from service.database.tables import jobs
from service.jobs.claim_order import enter_queue
from service.jobs.model import JobRow
from service.jobs.transitions import JobTransitions
from tests.factories.jobs import CLOUD, LEASE_S, OUTCOME, add, claim, new_job, open_transitions

AWAY = CloudInput(url="http://there/cloud.ply")


def add_many(transitions: JobTransitions, tenant: str, count: int, priority: int = 0) -> None:
    for _ in range(count):
        add(transitions, tenant=tenant, priority=priority)


def finish(transitions: JobTransitions, job: JobRow) -> None:
    assert transitions.succeed(job, OUTCOME, None)


def test_a_tenant_does_not_wait_behind_the_whole_queue_of_another(
    transitions: JobTransitions,
) -> None:
    add_many(transitions, "a", 50)
    running = claim(transitions)
    mine = add(transitions, tenant="b")
    finish(transitions, running)
    assert claim(transitions).id == mine.id


def test_priority_goes_before_no_other_tenant(transitions: JobTransitions) -> None:
    add_many(transitions, "b", 2)
    add_many(transitions, "a", 10, priority=100)
    tenants = []
    for _ in range(4):
        job = claim(transitions)
        tenants.append(job.tenant)
        finish(transitions, job)
    assert sorted(tenants[:2]) == sorted(tenants[2:]) == ["a", "b"]


def test_one_worker_serves_the_tenants_by_turns(transitions: JobTransitions) -> None:
    add_many(transitions, "a", 6)
    add_many(transitions, "b", 2)
    add_many(transitions, "c", 2)
    served = []
    for _ in range(10):
        job = claim(transitions)
        served.append(job.tenant)
        finish(transitions, job)
    assert served == ["a", "b", "c", "a", "b", "c", "a", "a", "a", "a"]


def test_the_tenant_with_the_fewest_running_jobs_is_next(transitions: JobTransitions) -> None:
    add_many(transitions, "a", 3)
    first, second = claim(transitions), claim(transitions)
    add_many(transitions, "b", 5)
    assert [claim(transitions).tenant for _ in range(2)] == ["b", "b"]
    finish(transitions, first)
    finish(transitions, second)
    assert claim(transitions).tenant == "a"


def test_deleting_what_has_ended_buys_no_turn(transitions: JobTransitions) -> None:
    add_many(transitions, "a", 3)
    add_many(transitions, "b", 1)
    job = claim(transitions)
    assert job.tenant == "a"
    finish(transitions, job)
    assert transitions.remove(job.id)
    assert claim(transitions).tenant == "b"


def test_fetches_and_registrations_have_turns_of_their_own(transitions: JobTransitions) -> None:
    """What a tenant has fetched takes no worker from it, and no turn."""
    add_many(transitions, "a", 2)
    for _ in range(2):
        add(transitions, tenant="a", source=AWAY)
    assert claim(transitions, "fetch").source == AWAY
    add_many(transitions, "b", 1)
    assert [claim(transitions).tenant for _ in range(3)] == ["a", "b", "a"]
    assert not transitions.is_claimable("register")
    assert transitions.is_claimable("fetch")


def test_a_tenant_gets_no_more_than_its_limit(transitions: JobTransitions) -> None:
    add_many(transitions, "a", 3)
    assert transitions.claim("register", 2, lease_s=LEASE_S) is not None
    assert transitions.claim("register", 2, lease_s=LEASE_S) is not None
    assert not transitions.is_claimable("register", 2)
    assert transitions.claim("register", 2, lease_s=LEASE_S) is None
    add_many(transitions, "b", 1)
    assert transitions.claim("register", 2, lease_s=LEASE_S) is not None


def test_the_worker_goes_on_with_the_attempt_of_the_fetch(transitions: JobTransitions) -> None:
    add(transitions, source=AWAY)
    fetch = claim(transitions, "fetch")
    fetched = replace(fetch, source=CLOUD, timing={"fetch_s": 1.0})
    assert transitions.record_fetched(fetched)
    assert not transitions.record_fetched(fetched)
    register = claim(transitions)
    assert (register.id, register.attempt, register.source) == (fetch.id, 1, CLOUD)
    assert not transitions.fail(fetch, {"detail": "late"}, {})
    assert not transitions.record_fetched(fetched)
    assert transitions.succeed(register, OUTCOME, None)


def test_claims_at_the_same_time_share_alike(transitions: JobTransitions) -> None:
    for tenant in ("a", "b", "c"):
        add_many(transitions, tenant, 10)
    with ThreadPoolExecutor(6) as threads:
        claimed = list(threads.map(lambda _: transitions.claim(lease_s=LEASE_S), range(12)))
    assert Counter(job.tenant for job in claimed if job) == {"a": 4, "b": 4, "c": 4}


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_five_jobs_behind_five_hundred_end_within_twice_their_time(
    database: Database, workers: int
) -> None:
    transitions = open_transitions(database, queue_limit=1000)
    alone = count_rounds(transitions, workers)
    with database.write() as connection:
        rows = [asdict(new_job(tenant="a")) for _ in range(500)]
        connection.execute(insert(jobs), rows)
        enter_queue(connection, "a", "register")
    assert count_rounds(transitions, workers) <= 2 * alone


def count_rounds(transitions: JobTransitions, workers: int) -> int:
    """How often each worker has run a job until the five of a tenant have ended."""
    add_many(transitions, "b", 5)
    ended = rounds = 0
    while ended < 5:
        claimed = [transitions.claim(lease_s=LEASE_S) for _ in range(workers)]
        for job in claimed:
            if job is not None:
                finish(transitions, job)
                ended += job.tenant == "b"
        rounds += 1
    return rounds
