"""Callbacks are sent in turns of tenants and hosts, and replays are bounded."""

from __future__ import annotations

from collections import Counter

import pytest

from service.database.engine import Database
from service.jobs.transitions import JobTransitions
from service.problems import QuotaExceededError
from service.webhooks.outbox import MAX_MESSAGES, DeliveryRow, Outbox
from tests.factories.jobs import add, open_transitions

SENDERS = 8


@pytest.fixture
def transitions(database: Database) -> JobTransitions:
    return open_transitions(database)


@pytest.fixture
def outbox(database: Database) -> Outbox:
    return Outbox(database)


def end(transitions: JobTransitions, tenant: str, host: str = "there", count: int = 1) -> str:
    """Id of the last of some jobs that have ended and call back."""
    for _ in range(count):
        job = add(transitions, tenant=tenant, callback_url=f"http://{host}/hook")
        transitions.cancel(job.id)
    return job.id


def take(outbox: Outbox) -> list[DeliveryRow]:
    """What the senders take while no host answers."""
    taken: list[DeliveryRow] = []
    while (delivery := outbox.claim(SENDERS - len(taken))) is not None:
        taken.append(delivery)
    return taken


def finish(outbox: Outbox, delivery: DeliveryRow) -> None:
    outbox.record_attempt(delivery, {"at": 1.0}, "delivered", None)


def test_a_silent_host_does_not_delay_another_tenant(
    transitions: JobTransitions, outbox: Outbox
) -> None:
    end(transitions, "a", count=30)
    silent = take(outbox)
    assert 1 <= len(silent) < SENDERS
    end(transitions, "b")  # at the same host
    delivery = outbox.claim(SENDERS - len(silent))
    assert delivery is not None
    assert delivery.tenant == "b"


def test_a_silent_host_does_not_delay_another_host(
    transitions: JobTransitions, outbox: Outbox
) -> None:
    end(transitions, "a", "silent", count=30)
    silent = take(outbox)
    end(transitions, "a", "other")
    delivery = outbox.claim(SENDERS - len(silent))
    assert delivery is not None
    assert delivery.host == "other"


def test_tenants_take_turns_where_hosts_answer(transitions: JobTransitions, outbox: Outbox) -> None:
    end(transitions, "a", count=10)
    end(transitions, "b", count=3)
    served = []
    for _ in range(6):
        delivery = outbox.claim(1)
        assert delivery is not None
        served.append(delivery.tenant)
        finish(outbox, delivery)
    assert Counter(served) == {"a": 3, "b": 3}


def test_replays_of_what_waits_send_it_now_and_add_nothing(
    transitions: JobTransitions, outbox: Outbox
) -> None:
    job = end(transitions, "a")
    delivery = outbox.claim(SENDERS)
    assert delivery is not None
    outbox.record_attempt(delivery, {"at": 1.0}, "pending", 3600)
    assert outbox.claim(SENDERS) is None
    for _ in range(60):
        assert outbox.replay(job)
    assert len(outbox.of_job(job)) == 1
    again = outbox.claim(SENDERS)
    assert again is not None
    assert again.id == delivery.id


def test_the_messages_of_a_registration_are_bounded(
    transitions: JobTransitions, outbox: Outbox
) -> None:
    job = end(transitions, "a")
    for number in range(1, MAX_MESSAGES + 1):
        assert len(outbox.of_job(job)) == number
        delivery = outbox.claim(SENDERS)
        assert delivery is not None
        finish(outbox, delivery)
        if number < MAX_MESSAGES:
            assert outbox.replay(job)
    with pytest.raises(QuotaExceededError, match="limit 20"):
        outbox.replay(job)


def test_what_has_not_ended_or_calls_nobody_is_not_replayed(
    transitions: JobTransitions, outbox: Outbox
) -> None:
    silent = add(transitions)
    transitions.cancel(silent.id)
    assert not outbox.replay(silent.id)
    assert not outbox.replay(add(transitions, callback_url="http://there/hook").id)
    assert not outbox.replay("unknown")
