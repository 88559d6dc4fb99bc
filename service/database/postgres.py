"""PostgreSQL: the database that several service processes share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from sqlalchemy import Connection, Engine, create_engine, func, make_url, select, text

from service.database.clock import read_time
from service.database.errors import translate_errors
from service.database.migrate import is_current, migrate
from service.database.postgres_listener import (
    CHANNEL,
    KEEPALIVE_S,
    SERVER_KEEPALIVE,
    PostgresListener,
)
from service.database.postgres_liveness import replace_lost_connections

POOL_SIZE = 20
"""Most connections of one service, of the 100 that a server allows by default."""
CONNECT_TIMEOUT_S = 10
SILENCE_S = 20
"""Time after which a server whose machine is gone counts as lost, in seconds."""
MAX_IDLE_MS = 15_000
"""Time between two statements of a transaction after which the server ends it, in milliseconds: the
machine of who holds its locks may be suspended."""
ADVISORY_LOCK_ID = 7_073_025
"""Key of the advisory lock that exclusive transactions hold; an arbitrary number."""


_NOTIFY = text("SELECT pg_notify(:channel, :message)")


class PostgresDatabase:
    """A `service.database.engine.Database` on a server, used by any number of processes."""

    poll_interval_s: float = 5.0
    """A fallback: other processes announce their changes, except while a connection is lost."""

    def __init__(self, url: str) -> None:
        self._url = url
        options = f"{SERVER_KEEPALIVE} -c idle_in_transaction_session_timeout={MAX_IDLE_MS}"
        self._engine = _create_engine(url, options)
        self._snapshot_engine = self._engine.execution_options(isolation_level="REPEATABLE READ")
        # the driver begins no transactions here: those of `write` begin in _begin alone
        self._plain_engine = self._engine.execution_options(isolation_level="AUTOCOMMIT")
        try:
            with self.read() as connection:
                must_migrate = not is_current(connection)
            if must_migrate:  # others do not write meanwhile
                with self.write(exclusive=True) as connection:
                    migrate(connection)
        except BaseException:
            self.close()
            raise

    @contextmanager
    def read(self, *, single: bool = False) -> Iterator[Connection]:
        """Open a snapshot to read from; a single statement is one by itself."""
        engine = self._plain_engine if single else self._snapshot_engine
        with translate_errors(), engine.connect() as connection:
            yield connection
            connection.commit()  # a rollback makes the driver forget its prepared statements

    @contextmanager
    def write(
        self, *, exclusive: bool = False, durable: bool = True, single: bool = False
    ) -> Iterator[Connection]:
        """Open a transaction; others run beside it unless both are exclusive."""
        with translate_errors(), self._plain_engine.begin() as connection:
            if not single:
                _begin(connection, exclusive=exclusive, durable=durable)
            yield connection

    def announce(self, connection: Connection, message: str) -> None:
        """Tell the processes that listen, once the transaction is committed."""
        connection.execute(_NOTIFY, {"channel": CHANNEL, "message": message})

    def listen(self, hear: Callable[[str], None], missed: Callable[[], None]) -> PostgresListener:
        """Call `hear` with each message that is announced, in a thread of its own."""
        listener = PostgresListener(self._url, hear, missed)
        listener.start()
        return listener

    def orphan_cutoff(self) -> float:
        """Return the present: other processes live, so only a lease that has ended is orphaned."""
        with self.read() as connection:
            return read_time(connection)

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()


class PostgresSnapshot:
    """The rows as they are at one moment, for several reads; nothing is migrated."""

    def __init__(self, url: str) -> None:
        self._engine = _create_engine(url)
        with translate_errors():
            snapshots = self._engine.execution_options(isolation_level="REPEATABLE READ")
            self._connection = snapshots.connect()

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Read as of that moment."""
        with translate_errors():
            yield self._connection

    def export(self) -> str:
        """Return a name by which other connections see the same rows, until this is closed."""
        with translate_errors():
            return str(self._connection.scalar(select(func.pg_export_snapshot())))

    def close(self) -> None:
        """End the transaction and the connection."""
        self._connection.close()
        self._engine.dispose()


def _begin(connection: Connection, *, exclusive: bool, durable: bool) -> None:
    """Begin a transaction and say of what kind it is, in one round trip."""
    statements = ["BEGIN"]
    if not durable:
        statements.append("SET LOCAL synchronous_commit TO OFF")
    if exclusive:
        statements.append(f"SELECT pg_advisory_xact_lock({ADVISORY_LOCK_ID})")
    connection.exec_driver_sql("; ".join(statements))


def _create_engine(url: str, options: str = "") -> Engine:
    engine = create_engine(
        make_url(url).set(drivername="postgresql+psycopg"),
        hide_parameters=True,  # an error that is logged must not tell what a row holds
        pool_size=POOL_SIZE,
        max_overflow=0,
        connect_args={
            "connect_timeout": CONNECT_TIMEOUT_S,
            "application_name": "mpe",
            "client_encoding": "utf8",
            "options": options,
            "keepalives_idle": KEEPALIVE_S,
            "keepalives_interval": KEEPALIVE_S // 2,
            "keepalives_count": 2,
            "tcp_user_timeout": 1000 * SILENCE_S,
        },
    )
    replace_lost_connections(engine)
    return engine
