"""Outbox of callbacks: planned in the transaction that ends a job, kept until delivered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sqlalchemy import Row, and_, func, select, update

from service.database.clock import now
from service.database.engine import Database
from service.database.tables import deliveries, jobs
from service.jobs.claim_order import record_turn
from service.jobs.events import plan_delivery
from service.jobs.model import TERMINAL_STATUSES, DeliveryStatus
from service.jobs.rows import find_job
from service.problems import QuotaExceededError
from service.webhooks.send_order import QUEUE, find_next

SENDING_TIMEOUT_S = 60.0
"""Seconds after which an unfinished attempt is repeated: its process must have been killed."""
MAX_MESSAGES = 20
"""Messages of one registration, replays included."""


@dataclass(frozen=True, slots=True)
class DeliveryRow:
    """One message and the attempts to deliver it; times in seconds since the epoch, UTC."""

    id: str
    job_id: str
    tenant: str
    host: str
    """Host and port of the callback."""
    status: DeliveryStatus
    created_at: float
    next_at: float | None
    """When the next attempt is due; while sending, when the attempt counts as lost."""
    tries: list[dict[str, Any]]


class Outbox:
    """Deliveries in the database."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def of_job(self, job_id: str) -> list[DeliveryRow]:
        """Return the deliveries of a job, oldest first."""
        query = select(deliveries).where(deliveries.c.job_id == job_id)
        with self._database.read() as connection:
            rows = connection.execute(query.order_by(deliveries.c.created_at))
            return [_delivery(row) for row in rows]

    def replay(self, job_id: str) -> bool:
        """Send the message of a job again: now, if it waits for its next attempt, else once more.

        Returns False when the job has not ended or has no callback.

        Raises
        ------
        QuotaExceededError
            The job has MAX_MESSAGES already.
        """
        of_job = deliveries.c.job_id == job_id
        waits = and_(of_job, deliveries.c.status == "pending")
        ended = and_(jobs.c.status.in_(TERMINAL_STATUSES), jobs.c.callback_url.is_not(None))
        with self._database.write(exclusive=True) as connection:
            job = find_job(connection, jobs.c.id == job_id, ended)
            if job is None:
                return False
            soon = update(deliveries).where(waits).values(next_at=now())
            if not connection.execute(soon).rowcount:
                _check_messages(connection.scalar(select(func.count()).where(of_job)) or 0)
                plan_delivery(connection, job)
        return True

    def claim(self, free: int) -> DeliveryRow | None:
        """Take the next delivery, in the order of `service.webhooks.send_order`.

        Parameters
        ----------
        free
            Senders without a call, the one that asks included.

        Returns
        -------
        DeliveryRow or None
            None when no delivery may be sent now.
        """
        with self._database.read() as connection:
            if find_next(connection, free) is None:
                return None
        with self._database.write(exclusive=True) as connection:
            row = find_next(connection, free)
            if row is None:
                return None
            values = {"status": "sending", "next_at": now() + SENDING_TIMEOUT_S}
            take = update(deliveries).where(deliveries.c.id == row.id).values(**values)
            taken = connection.execute(take.returning(deliveries)).one()
            record_turn(connection, taken.tenant, QUEUE)
        return _delivery(taken)

    def record_attempt(
        self,
        delivery: DeliveryRow,
        attempt: dict[str, Any],
        status: DeliveryStatus,
        retry_in_s: float | None = None,
    ) -> None:
        """Record an attempt and its outcome, unless another attempt has begun since `claim`."""
        next_at = None if retry_in_s is None else now() + retry_in_s
        values = {"status": status, "next_at": next_at, "tries": [*delivery.tries, attempt]}
        is_current = and_(deliveries.c.id == delivery.id, deliveries.c.next_at == delivery.next_at)
        with self._database.write() as connection:
            connection.execute(update(deliveries).where(is_current).values(**values))

    def requeue_interrupted(self) -> None:
        """Make the deliveries that a killed process was sending due again."""
        cutoff = self._database.orphan_cutoff()
        interrupted = update(deliveries).where(
            deliveries.c.status == "sending", deliveries.c.next_at < cutoff
        )
        with self._database.write() as connection:
            connection.execute(interrupted.values(status="pending", next_at=now()))


def _check_messages(messages: int) -> None:
    if messages >= MAX_MESSAGES:
        raise QuotaExceededError(
            f"The registration has {messages} messages (limit {MAX_MESSAGES}); no further one is "
            "sent.",
            members={"limit": "messages", "used": messages, "allowed": MAX_MESSAGES},
        )


def _delivery(row: Row[Any]) -> DeliveryRow:
    return DeliveryRow(**row._mapping)
