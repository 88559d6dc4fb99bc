"""Large clouds go to workers with the label `large` alone, and nobody waits for one unseen."""

from __future__ import annotations

import logging
from dataclasses import replace

import pytest

from service.clouds.inputs import CloudInput
from service.database.engine import Database
from service.jobs.missing_workers import MissingWorkers
from service.jobs.queries import JobQueries
from service.jobs.sizes import LARGE, served_queues
from service.jobs.transitions import JobTransitions
from service.jobs.worker_slots import SLOTS_LEASE_S, WorkerSlots
from service.schemas.serialize_job import summarize_job
from tests.factories.clock_of_tests import pass_time
from tests.factories.jobs import CLOUD, LEASE_S, OUTCOME, TENANT, add, claim, open_transitions

BIG = CloudInput(sha256="cd", size=100)
AWAY = CloudInput(url="http://there/cloud.ply")


@pytest.fixture
def transitions(database: Database) -> JobTransitions:
    return open_transitions(database, large_bytes=100)


def claim_with(transitions: JobTransitions, *labels: str) -> str | None:
    """Id of the job that a worker with these labels runs next."""
    for queue in served_queues(labels):
        if (job := transitions.claim(queue, lease_s=LEASE_S)) is not None:
            return job.id
    return None


def test_a_large_job_waits_for_a_worker_with_the_label(transitions: JobTransitions) -> None:
    small, large = add(transitions), add(transitions, target=BIG)
    assert [claim_with(transitions, "gpu") for _ in range(2)] == [small.id, None]
    assert claim_with(transitions, "gpu", LARGE) == large.id


def test_a_worker_with_the_label_does_first_what_it_alone_can(transitions: JobTransitions) -> None:
    small, large = add(transitions), add(transitions, target=BIG)
    assert [claim_with(transitions, LARGE) for _ in range(2)] == [large.id, small.id]


def test_what_is_fetched_counts_once_it_is_there(transitions: JobTransitions) -> None:
    add(transitions, source=AWAY)
    fetch = claim(transitions, "fetch")
    assert transitions.record_fetched(replace(fetch, source=BIG))
    assert claim_with(transitions) is None
    assert claim_with(transitions, LARGE) == fetch.id


def test_a_job_that_ran_out_of_memory_runs_once_more_on_a_larger_worker(
    database: Database, transitions: JobTransitions
) -> None:
    add(transitions)
    first = claim(transitions)
    assert not transitions.retry_on_larger(first)  # none is there
    WorkerSlots(database, 1, [LARGE]).announce()
    assert transitions.retry_on_larger(first)
    assert not transitions.succeed(first, OUTCOME, None)
    assert claim_with(transitions) is None
    second = claim(transitions, "large")
    assert (second.id, second.attempt) == (first.id, 2)
    assert not transitions.retry_on_larger(second)
    assert transitions.succeed(second, OUTCOME, None)


def test_a_job_says_what_it_waits_for(transitions: JobTransitions, queries: JobQueries) -> None:
    job = add(transitions, target=BIG)
    assert summarize_job(job).progress.needs_label == LARGE
    assert transitions.cancel(job.id)
    ended = queries.get(TENANT, job.id)
    assert ended is not None
    assert summarize_job(ended).progress.needs_label is None


def test_missing_workers_are_told_until_they_are_there(
    database: Database, transitions: JobTransitions, queries: JobQueries
) -> None:
    small = WorkerSlots(database, 2)
    missing = MissingWorkers(queries, small)
    assert missing.describe() == []  # nothing waits
    add(transitions)
    add(transitions, target=BIG)
    assert missing.count() == {"register": 1, "large": 1}
    small.announce()
    [text] = missing.describe()
    assert "mpe worker --labels large" in text
    large = WorkerSlots(database, 3, [LARGE, "gpu"])
    large.announce()
    assert (missing.describe(), large.count_by_label()) == ([], {"gpu": 3, "large": 3})
    pass_time(database, SLOTS_LEASE_S + 1)
    assert missing.count() == {"register": 1, "large": 1}


def test_missing_workers_are_logged_once(
    database: Database,
    transitions: JobTransitions,
    queries: JobQueries,
    caplog: pytest.LogCaptureFixture,
) -> None:
    missing = MissingWorkers(queries, WorkerSlots(database, 1))
    add(transitions, source=CLOUD)
    with caplog.at_level(logging.WARNING):
        missing.log()
        add(transitions)
        missing.log()
    assert len(caplog.records) == 1
