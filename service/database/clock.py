"""The clock of the database, which all services on it share: theirs need not agree.

SQLite has one process, whose clock it is.
"""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import Connection, Float, select
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import GenericFunction

SQLITE_FUNCTION = "mpe_now"


class now(GenericFunction[float]):  # noqa: N801
    """Expression: the present, in seconds since the epoch, UTC."""

    type = Float()
    name = SQLITE_FUNCTION
    inherit_cache = True


@compiles(now, "postgresql")
def _compile_for_postgres(*_: Any, **__: Any) -> str:
    return "CAST(EXTRACT(EPOCH FROM statement_timestamp()) AS DOUBLE PRECISION)"


def read_time(connection: Connection) -> float:
    """Return the present, in seconds since the epoch, UTC."""
    moment: float = connection.scalar(_QUERY) or 0.0
    return moment


def add_clock(connection: Any) -> None:
    """Give a connection of SQLite the function that `now` calls."""
    connection.create_function(SQLITE_FUNCTION, 0, lambda: time.time())  # tests set time.time


_QUERY = select(now())
