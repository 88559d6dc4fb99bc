"""What is recorded together with the end of a job."""

from __future__ import annotations

from service.clouds.inputs import CloudInput
from service.database.engine import Database
from service.jobs.queries import JobQueries
from service.jobs.transitions import JobTransitions
from service.webhooks.outbox import Outbox
from tests.factories.jobs import CLOUD, OUTCOME, TENANT, add, claim

SIGNED = "https://user:word@host/a.ply?signature=secret"


def test_secrets_of_urls_are_dropped_at_the_end_and_not_before(
    transitions: JobTransitions, queries: JobQueries
) -> None:
    add(transitions, source=CloudInput(url=SIGNED))
    job = claim(transitions, "fetch")
    assert job.source.url == SIGNED
    transitions.fail(job, {"detail": "x"}, {})
    ended = queries.get(TENANT, job.id)
    assert ended is not None
    assert ended.source.url == "https://host/a.ply"
    assert ended.target == CLOUD


def test_the_end_plans_one_call_to_the_callback(
    transitions: JobTransitions, database: Database
) -> None:
    outbox = Outbox(database)
    add(transitions, callback_url="http://host/hook")
    job = claim(transitions)
    assert outbox.of_job(job.id) == []
    transitions.succeed(job, OUTCOME, None)
    (delivery,) = outbox.of_job(job.id)
    assert (delivery.status, delivery.tries) == ("pending", [])


def test_a_known_result_is_called_back_too(transitions: JobTransitions, database: Database) -> None:
    add(transitions, work_key="w")
    transitions.succeed(claim(transitions), OUTCOME, "w")
    cached = add(transitions, work_key="w", callback_url="http://host/hook")
    assert len(Outbox(database).of_job(cached.id)) == 1


def test_without_a_callback_nothing_is_planned(
    transitions: JobTransitions, database: Database
) -> None:
    job = add(transitions)
    transitions.cancel(job.id)
    assert Outbox(database).of_job(job.id) == []
