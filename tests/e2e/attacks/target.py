"""The service that is attacked, and what its attackers hold."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import httpx

from tests.e2e.attacks.traps import Traps

ATTACKER_ADDRESS = "127.0.0.2"
"""Where attackers call from: the limits of one address are theirs alone."""
ANSWER_S = 30.0
HOLD_S = 3.0
"""How long an attacker holds what it has opened."""


@dataclass(frozen=True, slots=True)
class Target:
    """One service, as one attacker sees it."""

    port: int
    key: str
    traps: Traps
    job: str = ""
    """Id of a registration of the attacker that has succeeded; "" where there is none."""
    is_over: threading.Event = field(default_factory=threading.Event)

    @contextmanager
    def client(self) -> Iterator[httpx.Client]:
        """A client with the attacker's key."""
        with httpx.Client(
            base_url=f"http://127.0.0.1:{self.port}",
            headers={"Authorization": f"Bearer {self.key}"},
            timeout=ANSWER_S,
            transport=httpx.HTTPTransport(local_address=ATTACKER_ADDRESS),
        ) as client:
            yield client

    def connect(self) -> socket.socket:
        """A new connection that has said nothing yet."""
        return socket.create_connection(
            ("127.0.0.1", self.port), ANSWER_S, source_address=(ATTACKER_ADDRESS, 0)
        )

    def head(self, line: str, *headers: str) -> bytes:
        """Request line and headers, with the key."""
        lines = [
            f"{line} HTTP/1.1",
            "Host: localhost",
            f"Authorization: Bearer {self.key}",
            *headers,
        ]
        return "\r\n".join([*lines, "", ""]).encode()
