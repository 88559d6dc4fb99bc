"""Attacks by connections: they say little, nothing, or what is no request."""

from __future__ import annotations

import random
import socket
from contextlib import ExitStack, suppress

from tests.e2e.attacks.target import HOLD_S, Target

SILENT = 20
"""Connections that one attacker keeps open at once."""
BEGINNINGS = (
    b"",
    b"GET /livez HTTP/1.1\r\nHost: loc",
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    b"GET / HTTP/1.1\r\n\r\n",
    b"POST /v1/clouds HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000\r\n\r\nx",
)
CONFUSIONS = (
    b"PUT /v1/clouds/a HTTP/1.1\r\nHost: a\r\n"
    b"Content-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n1\r\na\r\n0\r\n\r\n",
    b"PUT /v1/clouds/a HTTP/1.1\r\nHost: a\r\nTransfer-Encoding:\r\n chunked\r\n\r\n",
    b"PUT /v1/clouds/a HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\nab",
    b"GET /livez HTTP/1.1\r\nHost: localhost\r\n" + b"A: b\r\n" * 5000,
    b"GET /" + b"a" * 60_000,
    b"\0" * 5000,
)
METHODS = 50


def stay_silent(target: Target, rng: random.Random) -> None:
    """Open connections, send no more than the beginning of a request, and hold them."""
    with ExitStack() as opened, suppress(OSError):
        for _ in range(SILENT):
            connection = opened.enter_context(target.connect())
            connection.sendall(rng.choice(BEGINNINGS))
        target.is_over.wait(HOLD_S)


def confuse_parsers(target: Target, rng: random.Random) -> None:
    """Send what two programs could read differently, or what is too long."""
    for sent in CONFUSIONS:
        _exchange(target, sent)


def invent_methods(target: Target, rng: random.Random) -> None:
    """Ask with methods that nobody knows, without a key."""
    lines = [f"BREW{rng.randrange(10**9)} /livez HTTP/1.1\r\nHost: localhost\r\n\r\n"] * METHODS
    _exchange(target, "".join(lines).encode())


def read_slowly(target: Target, rng: random.Random) -> None:
    """Ask for a file and read only its beginning."""
    if not target.job:
        return
    path = rng.choice(("aligned?format=xyz&merged=true", "inliers", "preview?role=target"))
    with suppress(OSError), target.connect() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.sendall(target.head(f"GET /v1/registrations/{target.job}/{path}"))
        connection.recv(100)
        target.is_over.wait(HOLD_S)


def abandon_uploads(target: Target, rng: random.Random) -> None:
    """Begin a large upload, send half of a piece, fall silent, and begin the piece again."""
    with target.client() as client, ExitStack() as opened:
        headers = {"Tus-Resumable": "1.0.0", "Upload-Length": str(8 * 2**20)}
        created = client.post("/v1/uploads", headers=headers)
        if created.status_code != 201:
            return
        place = created.headers["Location"]
        piece = target.head(
            f"PATCH {place}",
            *("Tus-Resumable: 1.0.0", "Upload-Offset: 0", "Content-Length: 1000000"),
            "Content-Type: application/offset+octet-stream",
        )
        with suppress(OSError):
            for _ in range(3):
                connection = opened.enter_context(target.connect())
                connection.sendall(piece)
            target.is_over.wait(HOLD_S)
        client.delete(place, headers=headers)


def _exchange(target: Target, sent: bytes) -> None:
    with suppress(OSError), target.connect() as connection:
        connection.settimeout(HOLD_S)
        connection.sendall(sent)
        connection.shutdown(socket.SHUT_WR)
        while connection.recv(65536):
            pass
