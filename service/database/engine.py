"""Access to the database: what the stores need of it, the same for SQLite and PostgreSQL.

What differs between the two is in `service.database.sqlite` and `service.database.postgres`.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol

from sqlalchemy import Connection

from service.database.postgres import PostgresDatabase
from service.database.sqlite import SqliteDatabase


class Closeable(Protocol):
    """Something that has an end."""

    def close(self) -> None:
        """End it."""


class Listening(Closeable, Protocol):
    """The connection by which a process hears of changes; one process on a database leads."""

    @property
    def is_leader(self) -> bool:
        """Whether this process does what is done once for all, such as clean-up."""

    @property
    def led_s(self) -> float:
        """Seconds that it has led without a break; 0 where it does not lead."""


class ReadableDatabase(Protocol):
    """A database that rows are read from."""

    def read(self) -> AbstractContextManager[Connection]:
        """Open a snapshot to read from."""


class Database(ReadableDatabase, Protocol):
    """An SQL database, migrated to the schema of this release when it is opened.

    `read` and `write` raise NotReadyError when the database does not answer, and
    InvalidRequestError when it cannot store a value.
    """

    @property
    def poll_interval_s(self) -> float:
        """Seconds between two looks of a process that waits for a row to change."""

    def read(self, *, single: bool = False) -> AbstractContextManager[Connection]:
        """Open a snapshot to read from.

        Parameters
        ----------
        single
            The block has one statement, which is a snapshot by itself: a server is asked once
            instead of three times.
        """

    def write(
        self, *, exclusive: bool = False, durable: bool = True, single: bool = False
    ) -> AbstractContextManager[Connection]:
        """Open a transaction; commit on exit, roll back on an exception.

        Parameters
        ----------
        exclusive
            Run alone among the exclusive transactions of all processes. Needed by what reads and
            then decides; a guarded update of one row is safe without.
        durable
            Wait for the disk. Otherwise the commit survives a crash of the process, but not of
            the machine, until a durable one has followed.
        single
            The block has one statement, which is a transaction by itself: durable, not exclusive.
        """

    def announce(self, connection: Connection, message: str) -> None:
        """Tell the processes that listen, once the transaction is committed."""

    def listen(self, hear: Callable[[str], None], missed: Callable[[], None]) -> Listening:
        """Call `hear` in a thread with each message that another process, or this one, announces.

        Parameters
        ----------
        hear
            Takes a message.
        missed
            Called when messages may have been missed.
        """

    def orphan_cutoff(self) -> float:
        """Return the time before which a lease must end to be orphaned, in epoch seconds.

        Asked at the start of a service, before it takes leases of its own.
        """

    def close(self) -> None:
        """Close all connections."""


def open_database(url: str) -> Database:
    """Open the database at a URL, `sqlite:///...` or `postgresql://...`, and migrate it.

    Raises
    ------
    NotReadyError
        The database does not answer.
    RuntimeError
        A later release has written it.
    """
    if url.startswith("sqlite"):
        return SqliteDatabase(url)
    return PostgresDatabase(url)
