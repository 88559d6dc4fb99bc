"""Connections that stand still end; those that move go on; what is no HTTP is refused."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from typing import Any

import pytest
from starlette.types import Receive, Scope, Send

from tests.factories.connections import exchange, serve

HEAD = b"POST /x HTTP/1.1\r\nHost: localhost\r\n"


async def echo(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer with the body, once it is complete; with nothing if the caller is gone."""
    body, more = b"", True
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        body += message["body"]
        more = message["more_body"]
    headers = [(b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": 200, "headers": headers})
    await send({"type": "http.response.body", "body": body})


def problem(response: bytes) -> tuple[int, dict[str, Any]]:
    """Status and document of a response; it is protected and closes the connection."""
    head, _, body = response.partition(b"\r\n\r\n")
    for header in (
        b"Content-Type: application/problem+json",
        b"X-Content-Type-Options: nosniff",
        b"Connection: close",
    ):
        assert header in head
    return int(head.split()[1]), json.loads(body)


@pytest.mark.parametrize("sent", [b"", b"GET /x HTTP/1.1\r\nHost: localhost\r\nX-A: "])
def test_a_head_that_does_not_arrive_ends_the_connection(sent: bytes) -> None:
    async def use(port: int) -> None:
        started = time.monotonic()
        response = await exchange(port, sent)
        assert time.monotonic() - started < 4
        assert not sent or problem(response)[0] == 408

    serve(echo, use, head_s=0.1)


def test_a_head_that_drips_has_the_same_time() -> None:
    async def use(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        sent = 0
        try:
            for byte in b"GET /x HTTP/1.1\r\n" + b"A: b\r\n" * 100:
                writer.write(bytes([byte]))
                await writer.drain()
                await asyncio.sleep(0.02)
                sent += 1
        except ConnectionError:
            pass
        assert sent < 200
        writer.close()
        del reader

    serve(echo, use, head_s=0.3)


@pytest.mark.parametrize(
    "head", [b"Content-Length: 1000000\r\n\r\nx", b"Transfer-Encoding: chunked\r\n\r\n5\r\nab"]
)
def test_a_body_that_stands_still_ends_the_connection(head: bytes) -> None:
    async def use(port: int) -> None:
        status, document = problem(await exchange(port, HEAD + head))
        assert (status, document["type"]) == (408, "urn:mpe:problem:request-timeout")

    serve(echo, use, stall_s=0.2)


def test_a_body_that_moves_may_take_long() -> None:
    async def use(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(HEAD + b"Content-Length: 20000\r\nConnection: close\r\n\r\n")
        for _ in range(20):
            writer.write(bytes(1000))
            await writer.drain()
            await asyncio.sleep(0.05)
        assert (await reader.read()).startswith(b"HTTP/1.1 200")
        writer.close()

    serve(echo, use, stall_s=0.4, head_s=0.2)


def test_an_application_that_does_not_read_is_not_the_callers_fault() -> None:
    async def slow(scope: Scope, receive: Receive, send: Send) -> None:
        await asyncio.sleep(0.6)
        await echo(scope, receive, send)

    async def use(port: int) -> None:
        body = bytes(500_000)
        head = HEAD + b"Content-Length: 500000\r\nConnection: close\r\n\r\n"
        assert (await exchange(port, head + body)).startswith(b"HTTP/1.1 200")

    serve(slow, use, stall_s=0.2)


def test_a_response_that_nobody_reads_ends_the_connection() -> None:
    size = 100 << 20

    async def large(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        for _ in range(100):
            await send({"type": "http.response.body", "body": bytes(1 << 20), "more_body": True})
        await send({"type": "http.response.body", "body": b""})

    async def use(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port, limit=1)
        writer.write(b"GET /x HTTP/1.1\r\nHost: localhost\r\n\r\n")
        await asyncio.sleep(1.0)
        received = 0
        with contextlib.suppress(ConnectionError):
            while piece := await asyncio.wait_for(reader.read(1 << 20), 5):
                received += len(piece)
        assert received < size
        writer.close()

    serve(large, use, stall_s=0.3)


def test_an_idle_connection_ends_and_one_in_use_does_not() -> None:
    async def use(port: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        for _ in range(4):
            writer.write(HEAD + b"Content-Length: 1\r\n\r\nx")
            assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200")
            assert await reader.readexactly(1) == b"x"
            await asyncio.sleep(0.15)
        assert await asyncio.wait_for(reader.read(), 3) == b""
        writer.close()

    serve(echo, use, head_s=0.2, idle_s=0.3)


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        (HEAD + b"Content-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n1\r\nx\r\n0\r\n\r\n", 400),
        (HEAD + b"Content-Length: 1\r\nContent-Length: 2\r\n\r\nxx", 400),
        (HEAD + b"Content-Length: -1\r\n\r\n", 400),
        (HEAD + b"Transfer-Encoding: gzip\r\n\r\n", 501),
        (HEAD + b"Transfer-Encoding:\r\n chunked\r\n\r\n1\r\nx\r\n0\r\n\r\n", 400),
        (HEAD + b"A: b\n\tc\r\n\r\n", 400),
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(40) + b"\r\n\r\n", 400),
        (b"GET /x HTTP/1.1\r\n\r\n", 400),
        (b"GET /x HTTP/1.1\r\nHost: localhost\r\nA: " + b"b" * 40_000, 431),
        (b"GET / x HTTP/1.1\r\nHost: localhost\r\n\r\n", 400),
    ],
)
def test_what_is_no_request_is_refused_with_a_problem_and_closed(sent: bytes, status: int) -> None:
    async def use(port: int) -> None:
        assert problem(await exchange(port, sent))[0] == status

    serve(echo, use)


async def tell(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer with what is asked for: hosts, path and query."""
    hosts = [value for name, value in scope["headers"] if name == b"host"]
    text = b" ".join([*hosts, scope["raw_path"], scope["query_string"]])
    headers = [(b"content-length", str(len(text)).encode())]
    await send({"type": "http.response.start", "status": 200, "headers": headers})
    await send({"type": "http.response.body", "body": text})


@pytest.mark.parametrize(
    ("target", "told"),
    [
        (b"/a?b=c", b"localhost /a b=c"),
        (b"http://there:80/a?b=c", b"there:80 /a b=c"),
        (b"HTTP://there", b"there / "),
        (b"https://there?b", b"there / b"),
    ],
)
def test_a_url_in_place_of_a_path_names_the_host(target: bytes, told: bytes) -> None:
    """RFC 9112, 3.2.2."""

    async def use(port: int) -> None:
        head = b" HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"
        assert (await exchange(port, b"GET " + target + head)).endswith(b"\r\n" + told)

    serve(tell, use)


def test_many_small_chunks_leave_turns_to_others() -> None:
    """By processor time: a busy machine makes others wait, too."""
    chunks = b"1\r\nx\r\n" * 50_000 + b"0\r\n\r\n"

    async def use(port: int) -> None:
        sending = asyncio.create_task(
            exchange(
                port, HEAD + b"Connection: close\r\nTransfer-Encoding: chunked\r\n\r\n" + chunks, 60
            )
        )
        pauses, last = [], time.thread_time()
        while not sending.done():
            await asyncio.sleep(0)
            now = time.thread_time()
            pauses.append(now - last)
            last = now
        assert (await sending).endswith(b"x" * 50_000)
        assert sorted(pauses)[-len(pauses) // 100 - 2] < 0.05
        assert len(pauses) > 200

    serve(echo, use)


def test_bytes_before_the_end_of_the_stream_are_parsed() -> None:
    received = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        while (message := await receive())["type"] == "http.request":
            received.append(message["body"])

    async def use(port: int) -> None:
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(HEAD + b"Content-Length: 1000000\r\n\r\n" + bytes(300_000))
        writer.write_eof()
        for _ in range(200):
            await asyncio.sleep(0.01)
            if sum(map(len, received)) == 300_000:
                break
        assert sum(map(len, received)) == 300_000
        writer.close()

    serve(app, use)
