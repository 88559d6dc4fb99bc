"""Acceptance of jobs: limits of the queue, idempotency keys, results that are known already."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from service.database.engine import Database
from service.jobs.idempotency import Idempotency
from service.jobs.queries import JobQueries
from service.jobs.transitions import JobTransitions
from service.problems import IdempotencyMismatchError, QueueFullError, QuotaExceededError
from tests.factories.jobs import OUTCOME, TENANT, add, claim, new_job, open_transitions


def test_queue_is_bounded(database: Database) -> None:
    transitions = open_transitions(database, queue_limit=2)
    add(transitions), add(transitions)
    with pytest.raises(QueueFullError) as caught:
        add(transitions)
    assert caught.value.members == {"queued": 2}
    assert int(caught.value.headers["Retry-After"]) > 0
    claim(transitions)
    add(transitions)


def test_queue_of_a_tenant_is_bounded(transitions: JobTransitions) -> None:
    transitions.add(new_job(), tenant_queue_limit=1)
    with pytest.raises(QuotaExceededError) as caught:
        transitions.add(new_job(), tenant_queue_limit=1)
    assert caught.value.members == {"limit": "queue_limit", "used": 1, "allowed": 1}
    transitions.add(new_job(tenant="other"), tenant_queue_limit=1)


def test_same_key_gives_the_same_job(transitions: JobTransitions) -> None:
    first = transitions.add(new_job(), Idempotency("k", "request"))
    assert transitions.add(new_job(), Idempotency("k", "request")) == first
    assert transitions.add(new_job(), Idempotency("other", "request")).id != first.id
    with pytest.raises(IdempotencyMismatchError):
        transitions.add(new_job(), Idempotency("k", "another request"))


def test_a_key_belongs_to_one_tenant(transitions: JobTransitions) -> None:
    first = transitions.add(new_job(), Idempotency("k", "request"))
    other = transitions.add(new_job(tenant="other"), Idempotency("k", "another request"))
    assert other.id != first.id


def test_a_replay_is_answered_though_the_queue_is_full(database: Database) -> None:
    transitions = open_transitions(database, queue_limit=1)
    first = transitions.add(new_job(), Idempotency("k", "request"))
    assert transitions.add(new_job(), Idempotency("k", "request")) == first


def test_a_key_of_a_refused_job_is_free(database: Database) -> None:
    transitions = open_transitions(database, queue_limit=1)
    add(transitions)
    with pytest.raises(QueueFullError):
        transitions.add(new_job(), Idempotency("k", "request"))
    claim(transitions)
    transitions.add(new_job(), Idempotency("k", "another request"))


def test_a_key_is_free_again_when_its_job_is_removed(transitions: JobTransitions) -> None:
    first = transitions.add(new_job(), Idempotency("k", "request"))
    transitions.cancel(first.id)
    transitions.remove(first.id)
    assert transitions.add(new_job(), Idempotency("k", "another request")).id != first.id


def test_same_work_is_done_once(transitions: JobTransitions, queries: JobQueries) -> None:
    add(transitions, work_key="w")
    assert add(transitions, work_key="w").status == "queued"
    assert transitions.succeed(claim(transitions), OUTCOME, "w")
    again = add(transitions, work_key="w")
    assert (again.status, again.cached, again.result_sha256) == ("succeeded", True, "result")
    assert queries.get(TENANT, again.id) == again
    assert add(transitions, work_key="v").status == "queued"


def test_a_known_result_takes_no_place_in_the_queue(database: Database) -> None:
    transitions = open_transitions(database, queue_limit=1)
    add(transitions, work_key="w")
    transitions.succeed(claim(transitions), OUTCOME, "w")
    add(transitions)
    assert add(transitions, work_key="w").cached


def test_a_result_of_another_tenant_is_not_reused(transitions: JobTransitions) -> None:
    add(transitions, work_key="w")
    transitions.succeed(claim(transitions), OUTCOME, "w")
    assert add(transitions, work_key="w", tenant="other").status == "queued"


@pytest.mark.parametrize("missing", ["result", "inliers"])
def test_a_result_whose_file_is_missing_is_computed_again(database: Database, missing: str) -> None:
    transitions = open_transitions(database, is_stored=lambda sha256: sha256 != missing)
    add(transitions, work_key="w")
    assert transitions.succeed(claim(transitions), OUTCOME, "w")
    assert add(transitions, work_key="w").status == "queued"


def test_others_may_write_while_files_are_looked_for(database: Database) -> None:
    """They may be on another machine, which does not answer."""
    with ThreadPoolExecutor(1) as threads:

        def look(sha256: str) -> bool:
            threads.submit(add, others).result(20)
            return True

        others, transitions = open_transitions(database), open_transitions(database, is_stored=look)
        add(transitions, work_key="w")
        assert transitions.succeed(claim(transitions), OUTCOME, "w")
        assert add(transitions, work_key="w").cached
