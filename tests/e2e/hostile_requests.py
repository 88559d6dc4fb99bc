"""Requests of a hostile client, as the soak sends them."""

from __future__ import annotations

import random
import socket
import time
from contextlib import suppress

import httpx

from tests.factories.scans import arms, as_npy

RAW = (
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    b"GET / HTTP/1.1\r\n\r\n",
    b"BREW-%d /livez HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"PUT /v1/clouds/a HTTP/1.1\r\nHost: a\r\n"
    b"Content-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n",
    b"GET /livez HTTP/1.1\r\nHost: localhost\r\n" + b"A: b\r\n" * 5000,
    b"POST /v1/clouds HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000\r\n\r\nx",
)
"""Bytes to a new connection, which then says nothing more."""
DIGITS = b"1\n1\n" + b"11111111 11111111 11111111\n" * 4 + b"x" * 40
BOUNDARY = "bX"


def send_something_hostile(client: httpx.Client, port: int, rng: random.Random) -> None:
    """Send one hostile request; whatever the answer is."""
    call = rng.choice((_say_little, _flood, _confuse_sniffers, _nest, _label))
    call(client, port, rng)


def _say_little(client: httpx.Client, port: int, rng: random.Random) -> None:
    with suppress(OSError), socket.create_connection(("127.0.0.1", port), 5) as connection:
        text = rng.choice(RAW)
        connection.sendall(text % rng.randrange(10**9) if b"%d" in text else text)
        time.sleep(rng.uniform(0, 1))


def _flood(client: httpx.Client, port: int, rng: random.Random) -> None:
    for _ in range(20):
        client.get(f"/v1/registrations?limit={rng.choice((1, -1, 10**9))}")


def _confuse_sniffers(client: httpx.Client, port: int, rng: random.Random) -> None:
    client.put("/v1/clouds/evil", content=rng.choice((DIGITS, bytes(4096), b"{" * 4000)))


def _nest(client: httpx.Client, port: int, rng: random.Random) -> None:
    headers = {"Content-Type": f"multipart/form-data; boundary={BOUNDARY}"}
    body = f"\r\n--{BOUNDARY[:-1]}".encode() * 20_000
    client.post("/v1/registrations", content=body, headers=headers)


def _label(client: httpx.Client, port: int, rng: random.Random) -> None:
    files = {"source": ("a", as_npy(arms(0, 3))), "target": ("b", as_npy(arms(0, 3)))}
    labels = '{"' + "x" * 60 + '": "' + "y" * 60_000 + '"}'
    client.post("/v1/registrations", files=files, data={"labels": labels})
