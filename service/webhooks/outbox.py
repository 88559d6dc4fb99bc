"""Outbox of callbacks: planned in the transaction that ends a job, kept until delivered."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Row, and_, select, update

from service.database.engine import Database
from service.database.tables import deliveries, jobs
from service.jobs.events import plan_delivery
from service.jobs.model import TERMINAL_STATUSES, DeliveryStatus

SENDING_TIMEOUT_S = 60.0
"""Seconds after which an unfinished attempt is repeated: its process must have been killed."""


@dataclass(frozen=True, slots=True)
class DeliveryRow:
    """One message and the attempts to deliver it; times in seconds since the epoch, UTC."""

    id: str
    job_id: str
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

    def replay(self, job_id: str) -> str | None:
        """Plan another delivery; None when the job has not ended or has no callback."""
        ended = and_(jobs.c.status.in_(TERMINAL_STATUSES), jobs.c.callback_url.is_not(None))
        with self._database.write() as connection:
            return plan_delivery(connection, select(jobs.c.id).where(jobs.c.id == job_id, ended))

    def claim(self) -> DeliveryRow | None:
        """Take the delivery that has been due longest; None when none is due."""
        now = time.time()
        unfinished = deliveries.c.status.in_(("pending", "sending"))
        due = and_(unfinished, deliveries.c.next_at <= now)
        first = (
            select(deliveries.c.id)
            .where(due)
            .order_by(deliveries.c.next_at)
            .limit(1)
            .with_for_update(skip_locked=True)
            .scalar_subquery()
        )
        take = update(deliveries).where(deliveries.c.id == first, due)
        take = take.values(status="sending", next_at=now + SENDING_TIMEOUT_S)
        with self._database.read() as connection:
            if connection.execute(select(deliveries.c.id).where(due).limit(1)).first() is None:
                return None
        with self._database.write() as connection:
            row = connection.execute(take.returning(deliveries)).one_or_none()
        return None if row is None else _delivery(row)

    def record_attempt(
        self,
        delivery: DeliveryRow,
        attempt: dict[str, Any],
        status: DeliveryStatus,
        next_at: float | None,
    ) -> None:
        """Record an attempt and its outcome, unless another attempt has begun since `claim`."""
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
            connection.execute(interrupted.values(status="pending", next_at=time.time()))


def _delivery(row: Row[Any]) -> DeliveryRow:
    return DeliveryRow(**row._mapping)
