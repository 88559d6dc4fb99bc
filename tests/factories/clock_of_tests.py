"""A clock that tests set forward, and the times of the store of blobs that they pass."""

from __future__ import annotations

import time

from sqlalchemy import Float, update

from service.database.engine import Database
from service.database.tables import metadata

GRACE_S = 600.0
CACHE_BYTES = 1 << 30


class Clock:
    """The time of a test; `wait` passes it at once."""

    def __init__(self) -> None:
        self.waited_s = 0.0

    def wait(self, seconds: float) -> None:
        self.waited_s += seconds

    @property
    def now(self) -> float:
        return time.time() + self.waited_s


def pass_time(database: Database, seconds: float) -> None:
    """Let all times in the database be earlier: the clock of PostgreSQL cannot be set."""
    with database.write() as connection:
        for table in metadata.sorted_tables:
            times = [column for column in table.c if column.name.endswith(("_at", "_until"))]
            earlier = {
                column: column - seconds for column in times if isinstance(column.type, Float)
            }
            if earlier:
                connection.execute(update(table).values(earlier))
