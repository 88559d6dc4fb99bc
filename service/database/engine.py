"""The database below the stores: SQLite beside the blobs, or PostgreSQL.

Durable commits, and snapshots to read from, that see no half of a transaction. What differs between
the two is here and nowhere else.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, func, make_url, select, text
from sqlalchemy.exc import DataError, OperationalError, TimeoutError

from service.database.migrate import migrate
from service.problems import InvalidRequestError, NotReadyError
from service.settings import Settings

SQLITE_CONNECTIONS = 32
"""Kept open; as many again for a while. More than the threads that ask: 40, and the workers."""
POSTGRES_CONNECTIONS = 20
"""At most, of the 100 that a server allows unless told otherwise; threads wait for their turn."""
CONNECT_S = 10
ALONE = 7_073_025
"""Any number: the key of the lock that `write(alone=True)` holds in PostgreSQL."""

log = logging.getLogger(__name__)


class Database:
    """An SQL database at a URL, migrated when opened."""

    def __init__(self, url: str) -> None:
        self.is_shared = not url.startswith("sqlite")
        """Whether other processes may work on it at the same time."""
        self._engine = _postgres(url) if self.is_shared else _sqlite(url)
        isolation = {"isolation_level": "REPEATABLE READ"} if self.is_shared else {}
        self._reader = self._engine.execution_options(**isolation)
        self._writer = self._engine.execution_options(writes=True)
        hurried = self._engine if self.is_shared else _sqlite(url, synchronous="NORMAL")
        self._hurried = hurried.execution_options(writes=True)
        # first come first served: SQLite's own waiting for the writer polls, and is unfair
        self._turn: AbstractContextManager[Any]
        self._turn = nullcontext() if self.is_shared else threading.Lock()
        try:
            self._migrate()
        except BaseException:
            self.close()
            raise

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """A snapshot to read from.

        NotReadyError when the database does not answer, here and in `write`; InvalidRequestError
        when it cannot hold what it was asked (NUL, in PostgreSQL).
        """
        with _explained(), self._reader.connect() as connection:
            yield connection

    @contextmanager
    def write(self, *, alone: bool = False, durable: bool = True) -> Iterator[Connection]:
        """A transaction; durable when the context is left, undone when it raises.

        One that need not be durable does not wait for the disk (SQLite: 0.5 ms, not 4 to 7, and
        the next writer waits for its turn): the crash of a process does not undo it, that of the
        machine may, until a durable one has followed.

        PostgreSQL runs several side by side: a guarded update of one row is safe there. What reads
        and then decides (may one more wait? is the key known?) has to be `alone`: one at a time,
        in whatever process. In SQLite every transaction is.
        """
        engine = self._writer if durable else self._hurried
        with _explained(), self._turn, engine.begin() as connection:
            if self.is_shared and not durable:
                connection.execute(text("SET LOCAL synchronous_commit TO OFF"))
            if alone and self.is_shared:
                _wait_alone(connection)
            yield connection

    def close(self) -> None:
        """Give the connections back."""
        self._engine.dispose()
        self._hurried.dispose()

    def _migrate(self) -> None:
        """Alone: another process that opens the database meanwhile waits, and finds it done."""
        with (
            _explained(),
            self._writer.connect() as connection,
            nullcontext() if self.is_shared else _foreign_keys_off(connection),
            connection.begin(),
        ):
            if self.is_shared:
                _wait_alone(connection)
            migrate(connection)


@contextmanager
def _explained() -> Iterator[None]:
    try:
        yield
    except (OperationalError, TimeoutError) as error:
        log.error("the job store does not answer: %s", error)
        raise NotReadyError("The job store does not answer; retry later.") from error
    except DataError as error:
        raise InvalidRequestError("A text has a character that cannot be stored.") from error


def _postgres(url: str) -> Engine:
    # a connection that the server closed meanwhile is replaced before it is used
    return create_engine(
        make_url(url).set(drivername="postgresql+psycopg"),
        hide_parameters=True,  # an error that is logged must not tell what a row holds
        pool_size=POSTGRES_CONNECTIONS,
        max_overflow=0,
        pool_pre_ping=True,
        connect_args={
            "connect_timeout": CONNECT_S,
            "application_name": "mpe",
            "client_encoding": "utf8",
        },
    )


def _wait_alone(connection: Connection) -> None:
    connection.execute(select(func.pg_advisory_xact_lock(ALONE)))


def _sqlite(url: str, *, synchronous: str = "FULL") -> Engine:
    engine = create_engine(
        url,
        hide_parameters=True,
        pool_size=SQLITE_CONNECTIONS,
        max_overflow=SQLITE_CONNECTIONS,
    )
    event.listen(engine, "connect", partial(_configure_sqlite, synchronous))
    event.listen(engine, "begin", _begin_sqlite)
    return engine


def open_database(settings: Settings) -> Database:
    """The database that the settings name."""
    return Database(settings.store_url)


def _configure_sqlite(synchronous: str, connection: Any, _: object) -> None:
    connection.isolation_level = None  # transactions begin where SQLAlchemy says, see below
    modes = ("busy_timeout=30000", "journal_mode=WAL", "foreign_keys=ON")
    for pragma in (*modes, f"synchronous={synchronous}"):
        connection.execute(f"PRAGMA {pragma}")


@contextmanager
def _foreign_keys_off(connection: Connection) -> Iterator[None]:
    """SQLite alters a table by making it anew: dropping the old one must not cascade."""
    cursor = connection.connection.cursor()
    cursor.execute("PRAGMA foreign_keys=OFF")
    yield
    cursor.execute("PRAGMA foreign_keys=ON")


def _begin_sqlite(connection: Connection) -> None:
    # a writer says so at once: a reader that turns writer fails when another one wrote meanwhile
    writes = connection.get_execution_options().get("writes", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")
