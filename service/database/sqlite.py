"""SQLite: the database of a single service process, a file in its data directory."""

from __future__ import annotations

import math
import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event

from service.database.clock import add_clock
from service.database.errors import translate_errors
from service.database.migrate import is_current, migrate

POOL_SIZE = 32
"""Connections kept open, and as many again under load: more than the threads that use them."""
PRAGMAS = ("busy_timeout=30000", "journal_mode=WAL", "foreign_keys=ON")


class SqliteDatabase:
    """A `service.database.engine.Database` in a file that no other process uses."""

    poll_interval_s: float = 15.0
    """A fallback: the process that waits is told of every change, since it makes them all."""

    def __init__(self, url: str) -> None:
        engine = _create_engine(url, synchronous="FULL")
        relaxed_engine = _create_engine(url, synchronous="NORMAL")
        self._engine = engine.execution_options(writes=False)
        self._durable_engine = engine.execution_options(writes=True)
        self._relaxed_engine = relaxed_engine.execution_options(writes=True)
        # first come, first served: SQLite's own waiting for the writer polls, and is unfair
        self._writer_lock = threading.Lock()
        try:
            self._migrate()
        except BaseException:
            self.close()
            raise

    @contextmanager
    def read(self, *, single: bool = False) -> Iterator[Connection]:
        """Open a snapshot to read from."""
        with translate_errors(), self._engine.connect() as connection:
            yield connection

    @contextmanager
    def write(
        self, *, exclusive: bool = False, durable: bool = True, single: bool = False
    ) -> Iterator[Connection]:
        """Open a transaction; every one is exclusive."""
        engine = self._durable_engine if durable else self._relaxed_engine
        with translate_errors(), self._writer_lock, engine.begin() as connection:
            yield connection

    def announce(self, connection: Connection, message: str) -> None:
        """Tell nobody: no other process uses the file."""

    def listen(self, hear: Callable[[str], None], missed: Callable[[], None]) -> AloneListening:
        """Hear nothing, as nothing is announced."""
        return AloneListening()

    def orphan_cutoff(self) -> float:
        """Return infinity: at the start, whatever another process held is orphaned."""
        return math.inf

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()
        self._relaxed_engine.dispose()

    def _migrate(self) -> None:
        # seldom needed, and to load the steps takes long: `mpe keys` must not hold up a service
        with self.read() as connection:
            if is_current(connection):
                return
        with (
            translate_errors(),
            self._durable_engine.connect() as connection,
            _foreign_keys_off(connection),
            connection.begin(),
        ):
            migrate(connection)


class AloneListening:
    """A `service.database.engine.Listening` of the only process."""

    is_leader = True
    led_s = math.inf

    def close(self) -> None:
        """Do nothing."""


class SqliteSnapshot:
    """A file of a store that is read alone, of whatever version; nothing is migrated."""

    def __init__(self, path: Path) -> None:
        uri = f"{path.absolute().as_uri()}?mode=ro"
        self._engine = create_engine(
            "sqlite://", creator=lambda: sqlite3.connect(uri, uri=True), hide_parameters=True
        )

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Open a snapshot to read from."""
        with translate_errors(), self._engine.connect() as connection:
            yield connection

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()


def _create_engine(url: str, *, synchronous: str) -> Engine:
    engine = create_engine(
        url,
        hide_parameters=True,  # an error that is logged must not tell what a row holds
        pool_size=POOL_SIZE,
        max_overflow=POOL_SIZE,
    )
    event.listen(engine, "connect", partial(_configure_connection, synchronous))
    event.listen(engine, "begin", _begin)
    return engine


def _configure_connection(synchronous: str, connection: Any, _: object) -> None:
    connection.isolation_level = None  # transactions begin in _begin alone
    add_clock(connection)
    for pragma in (*PRAGMAS, f"synchronous={synchronous}"):
        connection.execute(f"PRAGMA {pragma}")


def _begin(connection: Connection) -> None:
    # a writer takes the lock at once: a reader that turns writer fails if another wrote meanwhile
    writes = connection.get_execution_options()["writes"]
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


@contextmanager
def _foreign_keys_off(connection: Connection) -> Iterator[None]:
    """Suspend foreign keys: SQLite alters a table by making it anew, which must not cascade."""
    cursor = connection.connection.cursor()
    cursor.execute("PRAGMA foreign_keys=OFF")
    yield
    cursor.execute("PRAGMA foreign_keys=ON")
