"""How many registrations all services on one database can run at once."""

from __future__ import annotations

from uuid import uuid4

from sqlalchemy import delete, func, insert, select

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
    """

    def __init__(self, database: Database, number: int) -> None:
        self._database = database
        self._number = number
        self._service = str(uuid4())

    def begin(self) -> None:
        """Announce the slots for the first time, and drop those of services that are gone."""
        with self._database.write() as connection:
            is_orphan = worker_slots.c.lease_until < self._database.orphan_cutoff()
            connection.execute(delete(worker_slots).where(is_orphan))
        self.announce()

    def announce(self) -> None:
        """Let the slots count for another SLOTS_LEASE_S."""
        self._write(self._number)

    def withdraw(self) -> None:
        """Let them count no longer."""
        self._write(0)

    def count(self) -> int:
        """Return the slots of all services."""
        query = select(func.sum(worker_slots.c.number))
        with self._database.read() as connection:
            return connection.scalar(query.where(worker_slots.c.lease_until > now())) or 0

    def _write(self, number: int) -> None:
        is_own = worker_slots.c.service == self._service
        is_gone = worker_slots.c.lease_until < now()
        row = {"service": self._service, "number": number, "lease_until": now() + SLOTS_LEASE_S}
        with self._database.write(exclusive=True) as connection:
            connection.execute(delete(worker_slots).where(is_own | is_gone))
            if number:
                connection.execute(insert(worker_slots).values(**row))
