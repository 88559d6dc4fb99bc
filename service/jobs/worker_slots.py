"""How many registrations all services on one database can run at once, by label of the workers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from uuid import uuid4

from sqlalchemy import Connection, delete, insert, select

from service.database.clock import now
from service.database.engine import Database
from service.database.tables import worker_slots

SLOTS_LEASE_S = 30.0
"""Time after which the slots of a service that is gone no longer count, in seconds."""
ANNOUNCE_INTERVAL_S = SLOTS_LEASE_S / 3


class WorkerSlots:
    """Slots of this service, announced at intervals to the others on the database.

    Parameters
    ----------
    number : int
        Registrations that this service can run at once; 0 for one without workers.
    labels : sequence of str
        Labels of its workers.
    """

    def __init__(self, database: Database, number: int, labels: Sequence[str] = ()) -> None:
        self._database = database
        self.number = number
        self._labels = sorted(set(labels))
        self._service = str(uuid4())

    def begin(self) -> None:
        """Announce the slots for the first time, and drop those of services that are gone."""
        with self._database.write() as connection:
            is_orphan = worker_slots.c.lease_until < self._database.orphan_cutoff()
            connection.execute(delete(worker_slots).where(is_orphan))
        self.announce()

    def announce(self) -> None:
        """Let the slots count for another SLOTS_LEASE_S."""
        self._write(self.number)

    def withdraw(self) -> None:
        """Let them count no longer."""
        self._write(0)

    def count(self, label: str | None = None) -> int:
        """Return the slots of all services, or those whose workers have a label."""
        with self._database.read() as connection:
            return count_slots(connection, label)

    def count_by_label(self) -> dict[str, int]:
        """Return the slots of all services for each label that a worker has."""
        counts: Counter[str] = Counter()
        with self._database.read() as connection:
            for row in connection.execute(_LIVE):
                counts.update(dict.fromkeys(row.labels, row.number))
        return dict(sorted(counts.items()))

    def _write(self, number: int) -> None:
        is_own = worker_slots.c.service == self._service
        is_gone = worker_slots.c.lease_until < now()
        row = {"service": self._service, "number": number, "labels": self._labels}
        with self._database.write(exclusive=True) as connection:
            connection.execute(delete(worker_slots).where(is_own | is_gone))
            if number:
                connection.execute(
                    insert(worker_slots).values(**row, lease_until=now() + SLOTS_LEASE_S)
                )


def count_slots(connection: Connection, label: str | None = None) -> int:
    """Return the slots of all services, or those whose workers have a label."""
    live = connection.execute(_LIVE)
    return sum(row.number for row in live if label is None or label in row.labels)


_LIVE = select(worker_slots.c.number, worker_slots.c.labels).where(
    worker_slots.c.lease_until > now()
)
