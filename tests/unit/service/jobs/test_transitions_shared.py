"""Two services on one database: each thing is done once, whoever does it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from service.database.engine import Database, open_database
from service.jobs.idempotency import Idempotency
from service.jobs.queries import JobQueries
from service.jobs.transitions import JobTransitions
from service.problems import QueueFullError
from service.webhooks import outbox as deliveries
from service.webhooks.outbox import Outbox
from tests.factories.jobs import LEASE_S, add, claim, new_job, open_transitions

Stores = tuple[JobTransitions, JobTransitions]
LIMIT = 40


@pytest.fixture
def databases(url: str) -> Iterator[tuple[Database, Database]]:
    both = open_database(url), open_database(url)
    yield both
    for database in both:
        database.close()


@pytest.fixture
def stores(databases: tuple[Database, Database]) -> Stores:
    first, second = databases
    return open_transitions(first, queue_limit=LIMIT), open_transitions(second, queue_limit=LIMIT)


def at_once(stores: Stores, count: int, call: Callable[[JobTransitions], Any]) -> list[Any]:
    """What `count` calls give that are made side by side, by turns to both stores."""
    with ThreadPoolExecutor(8) as threads:
        return list(threads.map(lambda i: call(stores[i % 2]), range(count)))


def test_a_job_is_claimed_once(stores: Stores) -> None:
    jobs = [add(stores[0]) for _ in range(30)]
    taken = at_once(stores, 40, lambda one: one.claim(lease_s=LEASE_S))
    assert sorted(job.id for job in taken if job) == sorted(job.id for job in jobs)


def test_a_key_is_accepted_once(stores: Stores, databases: tuple[Database, Database]) -> None:
    key = Idempotency("k", "request")
    accepted = at_once(stores, 16, lambda one: one.add(new_job(), key).id)
    assert len(set(accepted)) == 1
    assert JobQueries(databases[1]).count("queued") == 1


def test_the_bound_of_the_queue_is_exact(stores: Stores) -> None:
    def is_accepted(one: JobTransitions) -> bool:
        try:
            return bool(add(one))
        except QueueFullError:
            return False

    assert sum(at_once(stores, 2 * LIMIT, is_accepted)) == LIMIT


def test_a_start_takes_up_only_what_nobody_holds(
    stores: Stores, databases: tuple[Database, Database]
) -> None:
    """With SQLite the one who starts is alone, and all that ran is over."""
    is_alone = databases[1].orphan_cutoff() == math.inf
    add(stores[0])
    held = claim(stores[0])
    assert stores[1].requeue_orphans() == (1 if is_alone else 0)
    if not is_alone:
        assert stores[0].extend_lease(held, lease_s=-1)
        assert stores[1].requeue_orphans() == 1
    assert claim(stores[1]).attempt == 2
    assert not stores[0].is_current(held)


def test_what_a_killed_sender_had_begun_is_sent_again(
    stores: Stores, databases: tuple[Database, Database], monkeypatch: pytest.MonkeyPatch
) -> None:
    add(stores[0], callback_url="http://there/hook")
    stores[0].fail(claim(stores[0]), {"detail": "x"}, {})
    first, second = (Outbox(database) for database in databases)
    assert first.claim(8) is not None
    assert second.claim(8) is None
    monkeypatch.setattr(deliveries, "SENDING_TIMEOUT_S", -deliveries.SENDING_TIMEOUT_S)
    add(stores[0], callback_url="http://there/hook")
    stores[0].fail(claim(stores[0]), {"detail": "x"}, {})
    slow = first.claim(8)
    assert slow is not None
    again = second.claim(8)
    assert again is not None
    assert again.id == slow.id
    first.record_attempt(slow, {"at": 1.0}, "failed")  # it came too late
    second.record_attempt(again, {"at": 2.0}, "delivered")
    (row,) = second.of_job(slow.job_id)
    assert (row.status, row.tries) == ("delivered", [{"at": 2.0}])
