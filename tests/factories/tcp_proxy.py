"""A TCP proxy before a server, whose network can be cut."""

from __future__ import annotations

import contextlib
import itertools
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import httpx

CHUNK_BYTES = 1 << 16
PATIENCE_S = 60.0
"""Wait of a balancer for a server that is ready: more than a busy machine takes to answer."""


class TcpProxy:
    """Forwards each connection to what `dial` opens, unless it is cut."""

    def __init__(self, dial: Callable[[], socket.socket], port: int = 0) -> None:
        self._dial = dial
        self._listening = socket.create_server(("127.0.0.1", port), backlog=128)
        self.port: int = self._listening.getsockname()[1]
        self._open: set[socket.socket] = set()
        self._lock = threading.Lock()
        self.is_cut = False
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self) -> None:
        """End every connection and let none through."""
        self.is_cut = True
        with self._lock:
            for each in self._open:
                with contextlib.suppress(OSError):
                    each.shutdown(socket.SHUT_RDWR)

    def mend(self) -> None:
        self.is_cut = False

    def close(self) -> None:
        self._listening.close()
        self.cut()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listening.accept()
            except OSError:
                return
            threading.Thread(target=self._forward, args=(client,), daemon=True).start()

    def _forward(self, client: socket.socket) -> None:
        with contextlib.suppress(OSError), client:
            if self.is_cut:
                return
            with self._dial() as server:
                with self._lock:
                    self._open |= {client, server}
                back = threading.Thread(target=_copy, args=(server, client), daemon=True)
                back.start()
                _copy(client, server)
                back.join()
                with self._lock:
                    self._open -= {client, server}


def _copy(one: socket.socket, other: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while chunk := one.recv(CHUNK_BYTES):
            other.sendall(chunk)
    for each in (one, other):
        with contextlib.suppress(OSError):
            each.shutdown(socket.SHUT_RDWR)


@contextmanager
def running_proxy(dial: Callable[[], socket.socket], port: int = 0) -> Iterator[TcpProxy]:
    proxy = TcpProxy(dial, port)
    try:
        yield proxy
    finally:
        proxy.close()


class Balancer:
    """Dials the servers that are ready, in turn."""

    def __init__(self, urls: Sequence[str]) -> None:
        self._urls = urls
        self._turns = itertools.count()

    def dial(self) -> socket.socket:
        """Wait until one is ready; raise ConnectionError when none is for PATIENCE_S."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            url = httpx.URL(self._urls[next(self._turns) % len(self._urls)])
            with contextlib.suppress(OSError, httpx.TransportError):
                if httpx.get(url.join("/readyz"), timeout=30, trust_env=False).is_success:
                    return socket.create_connection((url.host, url.port or 80))
            time.sleep(0.05)
        raise ConnectionRefusedError("no server is ready")
