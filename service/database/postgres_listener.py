"""A thread that hears what other processes on the same PostgreSQL database announce (LISTEN).

Its connection holds the lock of the leader, too. A process that dies loses it with its connection.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import psycopg

CHANNEL = "mpe_changes"
WAIT_S = 0.5
"""Longest wait for a message, in seconds, between two looks whether to stop."""
RECONNECT_S = 1.0
"""Pause before a lost connection is opened again, in seconds."""
CONNECT_TIMEOUT_S = 10
KEEPALIVE_S = 10
"""Time without a message after which TCP asks whether the server is there, in seconds."""
LEADER_LOCK_ID = 7_073_026
"""Key of the advisory lock that the leader holds; an arbitrary number."""
SERVER_KEEPALIVE = "".join(
    f" -c tcp_keepalives_{name}={value}"
    for name, value in (("idle", KEEPALIVE_S), ("interval", KEEPALIVE_S), ("count", 2))
)
"""Settings by which the server finds within 30 s that the machine of a leader is gone."""
log = logging.getLogger(__name__)


class PostgresListener:
    """Calls `hear` with each message, and `missed` when some may have been lost."""

    def __init__(self, url: str, hear: Callable[[str], None], missed: Callable[[], None]) -> None:
        self._url = url
        self._hear = hear
        self._missed = missed
        self._stopping = threading.Event()
        self._led_since: float | None = None
        self._thread = threading.Thread(target=self._run, name="listen", daemon=True)

    @property
    def is_leader(self) -> bool:
        """Whether this process holds the lock of the leader, as far as it knows."""
        return self._led_since is not None

    @property
    def led_s(self) -> float:
        """Seconds that this process has led; 0 where it does not."""
        since = self._led_since
        return 0.0 if since is None else time.monotonic() - since

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Stop the thread."""
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        import psycopg

        while not self._stopping.is_set():
            try:
                self._listen()
            except psycopg.Error as error:
                log.warning("no connection to hear of changes; polling instead: %s", error)
            except Exception:
                log.exception("a change could not be heard")
            finally:
                self._led_since = None
            self._stopping.wait(RECONNECT_S)

    def _listen(self) -> None:
        import psycopg

        with psycopg.connect(
            self._url,
            autocommit=True,
            application_name="mpe-listen",
            connect_timeout=CONNECT_TIMEOUT_S,
            keepalives_idle=KEEPALIVE_S,
            keepalives_interval=KEEPALIVE_S,
            keepalives_count=2,
            options=SERVER_KEEPALIVE,
        ) as connection:
            connection.execute(f"LISTEN {CHANNEL}")
            self._missed()
            while not self._stopping.is_set():
                if self._led_since is None and _try_lead(connection):
                    self._led_since = time.monotonic()
                for message in connection.notifies(timeout=WAIT_S):
                    self._hear(message.payload)
                    if self._stopping.is_set():
                        return


def _try_lead(connection: psycopg.Connection[tuple[Any, ...]]) -> bool:
    row = connection.execute("SELECT pg_try_advisory_lock(%s)", [LEADER_LOCK_ID]).fetchone()
    is_leader = row is not None and bool(row[0])
    if is_leader:
        log.info("this service leads: it cleans up and sends the callbacks of all")
    return is_leader
