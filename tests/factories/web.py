"""A small web server whose paths say how it is to behave, and the way to call it."""

from __future__ import annotations

import contextlib
import hashlib
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_network
from typing import Any

from service.outbound.url_policy import UrlPolicy
from service.storage.blobs import Blob

LOOPBACK = (ip_network("127.0.0.0/8"), ip_network("::1/128"))
OPEN = UrlPolicy(networks=LOOPBACK)
"""Everything public, and this machine, which stands for the public network in these tests."""
CONTENT = bytes(range(256)) * 400
SHA256 = hashlib.sha256(CONTENT).hexdigest()

Fetch = Callable[..., Blob]
"""The fixture `fetch`: downloads a URL."""
Behaviour = Callable[["Handler"], None]


class Handler(BaseHTTPRequestHandler):
    """Does what the server has for the path."""

    server: Web
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        self.server.requests.append((self.path, {k.lower(): v for k, v in self.headers.items()}))
        behaviour = self.server.behaviours.get(self.path.partition("?")[0])
        try:
            if behaviour is None:
                self.give(b"nothing here", status=404)
            else:
                behaviour(self)
        except (BrokenPipeError, ConnectionResetError, ssl.SSLError):
            self.close_connection = True

    def do_POST(self) -> None:
        self.do_GET()

    def head(self, status: int = 200, **headers: str) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()

    def give(self, body: bytes = CONTENT, status: int = 200, **headers: str) -> None:
        self.head(status, Content_Length=str(len(body)), **headers)
        self.wfile.write(body)

    def give_part(self, start: int, end: int, status: int = 200, **headers: str) -> None:
        """Promise the content from the start on, but end the connection early."""
        self.head(status, Content_Length=str(len(CONTENT) - start), **headers)
        self.wfile.write(CONTENT[start:end])
        self.close_connection = True

    def drip(self, *, every_s: float = 0.02) -> None:
        """One byte after the other, until the other side has enough."""
        while not self.server.is_closing.is_set():
            self.wfile.write(b"x")
            self.wfile.flush()
            time.sleep(every_s)

    def log_message(self, *_: object) -> None:
        pass


class Versioned:
    """A file of a server that knows conditional requests."""

    def __init__(self, **said: str) -> None:
        self.body = CONTENT
        self.said = said

    def __call__(self, handler: Handler) -> None:
        etag = self.said.get("ETag")
        same = (etag is not None and handler.headers.get("If-None-Match") == etag) or (
            "Last_Modified" in self.said
            and handler.headers.get("If-Modified-Since") == self.said["Last_Modified"]
        )
        if same:
            handler.head(304, **self.said)
        else:
            handler.give(self.body, **self.said)


class Web(ThreadingHTTPServer):
    """Counts its connections, keeps what it was asked."""

    daemon_threads = True
    request_queue_size = 64

    def __init__(self, address: str = "127.0.0.1", tls: ssl.SSLContext | None = None) -> None:
        self.address_family = socket.AF_INET6 if ":" in address else socket.AF_INET
        super().__init__((address, 0), Handler)
        self.behaviours: dict[str, Behaviour] = {"/file": lambda handler: handler.give()}
        self.requests: list[tuple[str, dict[str, str]]] = []
        self.connections = 0
        self.is_closing = threading.Event()
        self._tls = tls

    def get_request(self) -> tuple[Any, Any]:
        connection, address = super().get_request()
        self.connections += 1
        return connection, address

    def finish_request(self, request: Any, client_address: Any) -> None:
        if self._tls is None:
            super().finish_request(request, client_address)
            return
        with contextlib.suppress(OSError), self._tls.wrap_socket(request, server_side=True) as safe:
            super().finish_request(safe, client_address)

    def handle_error(self, request: object, client_address: Any) -> None:
        pass

    def url(self, path: str = "/file", host: str = "files.example") -> str:
        scheme = "http" if self._tls is None else "https"
        return f"{scheme}://{host}:{self.server_port}{path}"


@contextmanager
def serving(address: str = "127.0.0.1", tls: ssl.SSLContext | None = None) -> Iterator[Web]:
    with Web(address, tls) as web:
        threading.Thread(target=web.serve_forever, args=(0.02,), daemon=True).start()
        yield web
        web.is_closing.set()
        web.shutdown()


class Names:
    """A resolver that says what the tests want, one answer after the other; the last stays."""

    def __init__(self) -> None:
        self.answers: dict[str, list[str]] = {"files.example": ["127.0.0.1"]}
        self.turns: dict[str, list[list[str]]] = {}
        self.asked: list[str] = []

    def __call__(self, name: str) -> list[str]:
        self.asked.append(name)
        turns = self.turns.get(name)
        if turns:
            return turns.pop(0) if len(turns) > 1 else turns[0]
        if name not in self.answers:
            raise OSError("no such name")
        return self.answers[name]
