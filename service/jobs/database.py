"""The database below the stores: durable commits, one writer at a time, readers beside it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import Connection, create_engine, event

from service.jobs.schema import migrate
from service.settings import Settings

CONNECTIONS = 32
"""Kept open; as many again for a while. More than the threads that ask: 40, and the workers."""


class Database:
    """An SQL database at a URL: SQLite beside the blobs, or PostgreSQL; migrated when opened."""

    def __init__(self, url: str) -> None:
        self._engine = create_engine(
            url,
            pool_size=CONNECTIONS,
            max_overflow=CONNECTIONS,
            hide_parameters=True,  # an error that is logged must not tell what a row holds
        )
        if self._engine.dialect.name == "sqlite":
            event.listen(self._engine, "connect", _configure_sqlite)
            event.listen(self._engine, "begin", _begin_sqlite)
        self._writer = self._engine.execution_options(writes=True)
        # first come first served: SQLite's own waiting for the writer polls, and is unfair
        self._writing = threading.Lock()
        self._migrate()

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """A snapshot to read from."""
        with self._engine.connect() as connection:
            yield connection

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """A transaction; durable when the context is left, undone when it raises."""
        with self._writing, self._writer.begin() as connection:
            yield connection

    def _migrate(self) -> None:
        """Alone: another process that opens the database meanwhile waits, and finds it done."""
        with (
            self._writer.connect() as connection,
            _foreign_keys_off(connection),
            connection.begin(),
        ):
            migrate(connection)

    def close(self) -> None:
        """Give the connections back."""
        self._engine.dispose()


def open_database(settings: Settings) -> Database:
    """The database that the settings name."""
    return Database(f"sqlite:///{settings.data_dir / 'jobs.sqlite3'}")


def _configure_sqlite(connection: Any, _: object) -> None:
    connection.isolation_level = None  # transactions begin where SQLAlchemy says, see below
    for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=30000"):
        connection.execute(f"PRAGMA {pragma}")


@contextmanager
def _foreign_keys_off(connection: Connection) -> Iterator[None]:
    """SQLite alters a table by making it anew: dropping the old one must not cascade."""
    sqlite = connection.dialect.name == "sqlite"
    if sqlite:
        connection.connection.cursor().execute("PRAGMA foreign_keys=OFF")
    yield
    if sqlite:
        connection.connection.cursor().execute("PRAGMA foreign_keys=ON")


def _begin_sqlite(connection: Connection) -> None:
    # a writer says so at once: a reader that turns writer fails when another one wrote meanwhile
    writes = connection.get_execution_options().get("writes", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")
