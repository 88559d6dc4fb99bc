"""Listening sockets: connections are accepted as far as limits and file descriptors allow.

asyncio's own server, when descriptors run out, logs one error per connection that waits and tries
again at once; this one logs a line and pauses.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import time
from collections.abc import Callable
from functools import partial

from service.connections.guard import LOG_INTERVAL_S, ConnectionGuard
from service.connections.protocol import GuardedProtocol
from service.connections.refusal import refusal

log = logging.getLogger(__name__)

BACKLOG = 2048
"""Connections that the kernel holds until they are accepted."""
ACCEPTS_PER_STEP = 32
"""Connections accepted before other work of the event loop goes on."""
PAUSE_S = 0.5
"""Time without accepting after an error such as EMFILE, in seconds."""
KEEPALIVE_IDLE_S, KEEPALIVE_INTERVAL_S, KEEPALIVE_PROBES = 30, 10, 3
"""When TCP asks whether a silent peer still exists, and how often before it gives up."""

_TOO_MANY = refusal(
    503, "Too many connections are open; close some, or retry later.", retry_after_s=5
)


class Listener:
    """Accepts connections on its sockets; stands in for an `asyncio.Server` of uvicorn.

    Parameters
    ----------
    sockets : list of socket
        Bound, and closed by `close`.
    protocol : callable
        Makes the protocol of one connection.
    guard : ConnectionGuard
        Decides which connections are let in.
    """

    def __init__(
        self,
        sockets: list[socket.socket],
        protocol: Callable[[], GuardedProtocol],
        guard: ConnectionGuard,
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._sockets = sockets
        self._protocol = protocol
        self._guard = guard
        self._starting: set[asyncio.Task[None]] = set()
        self._log_again_at = 0.0
        self._is_open = False

    @property
    def addresses(self) -> list[str]:
        """Addresses that are listened at, as host:port."""
        return [_text_of(listening.getsockname()) for listening in self._sockets]

    def start(self) -> None:
        """Begin to accept."""
        self._is_open = True
        for listening in self._sockets:
            listening.setblocking(False)
            listening.listen(BACKLOG)
            self._resume(listening)

    def close(self) -> None:
        """Accept no more connections; those that are open go on."""
        self._is_open = False
        for listening in self._sockets:
            if listening.fileno() >= 0:
                self._loop.remove_reader(listening)
                listening.close()

    async def wait_closed(self) -> None:
        """Return at once: the protocols count what is open."""

    def _resume(self, listening: socket.socket) -> None:
        if self._is_open:
            self._loop.add_reader(listening, self._accept, listening)

    def _accept(self, listening: socket.socket) -> None:
        for _ in range(ACCEPTS_PER_STEP):
            try:
                connection, address = listening.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:
                self._pause(listening, error)
                return
            self._let_in(connection, address[0])

    def _pause(self, listening: socket.socket, error: OSError) -> None:
        self._loop.remove_reader(listening)
        self._loop.call_later(PAUSE_S, self._resume, listening)
        now = time.monotonic()
        if now >= self._log_again_at:
            self._log_again_at = now + LOG_INTERVAL_S
            log.error("no connection can be accepted (%s); trying again every %g s", error, PAUSE_S)

    def _let_in(self, connection: socket.socket, address: str) -> None:
        connection.setblocking(False)
        key = self._guard.admit(address)
        if key is None:
            with contextlib.suppress(OSError):
                connection.send(_TOO_MANY)
            connection.close()
            return
        task = self._loop.create_task(self._start(connection, partial(self._guard.release, key)))
        self._starting.add(task)
        task.add_done_callback(self._starting.discard)

    async def _start(self, connection: socket.socket, release: Callable[[], None]) -> None:
        protocol = self._protocol()
        protocol.on_lost = release
        try:
            _keep_alive(connection)
            await self._loop.connect_accepted_socket(lambda: protocol, connection)
        except OSError:  # the peer is gone again
            connection.close()
            if not protocol.has_begun:
                release()


async def bind(host: str, port: int) -> list[socket.socket]:
    """Bind a socket at each address of the host.

    Raises
    ------
    OSError
        The name has no address, or one of them cannot be bound.
    """
    found = await asyncio.get_running_loop().getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )
    sockets: list[socket.socket] = []
    try:
        for family, kind, protocol, _, address in dict.fromkeys(found):
            listening = socket.socket(family, kind, protocol)
            sockets.append(listening)
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                listening.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            listening.bind(address)
    except OSError:
        for listening in sockets:
            listening.close()
        raise
    return sockets


def _keep_alive(connection: socket.socket) -> None:
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in (
        ("TCP_KEEPIDLE", KEEPALIVE_IDLE_S),
        ("TCP_KEEPINTVL", KEEPALIVE_INTERVAL_S),
        ("TCP_KEEPCNT", KEEPALIVE_PROBES),
    ):
        if hasattr(socket, name):
            connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def _text_of(address: tuple[str, int]) -> str:
    host, port = address[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
