"""Draining: the rest of a body is read before an early response, within bounds."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from starlette.types import Message, Receive, Scope, Send

from service.api.middleware.drain_body import DrainBodyMiddleware

PIECE = bytes(10)
Next = Callable[[], Awaitable[Message]]


async def answer_early(scope: Scope, receive: Receive, send: Send) -> None:
    await send({"type": "http.response.start", "status": 413, "headers": []})


async def read_first(scope: Scope, receive: Receive, send: Send) -> None:
    while (await receive()).get("more_body"):
        pass
    await answer_early(scope, receive, send)


def pieces(count: int, *, last: str = "http.request") -> list[Message]:
    body: list[Message] = [
        {"type": "http.request", "body": PIECE, "more_body": True} for _ in range(count - 1)
    ]
    return [*body, {"type": last, "body": PIECE, "more_body": False}]


def run(
    app: Callable[..., Awaitable[None]],
    messages: list[Message],
    headers: list[tuple[bytes, bytes]],
    **bounds: Any,
) -> tuple[list[Message], list[int]]:
    """What is left unread, and how much was unread as each message was sent."""
    unread_at: list[int] = []

    async def receive() -> Message:
        if not messages:
            await asyncio.sleep(60)
        return messages.pop(0)

    async def send(_: Message) -> None:
        unread_at.append(len(messages))

    scope = {"type": "http", "headers": headers}
    asyncio.run(DrainBodyMiddleware(app, **bounds)(scope, receive, send))
    return messages, unread_at


@pytest.mark.parametrize("header", [b"content-length", b"transfer-encoding"])
def test_the_rest_is_read_before_the_response(header: bytes) -> None:
    _, unread_at = run(answer_early, pieces(5), [(header, b"50")])
    assert unread_at == [0]


def test_a_request_without_a_body_is_not_waited_for() -> None:
    assert run(answer_early, [], [])[1] == [0]


def test_a_body_that_was_read_is_not_waited_for() -> None:
    assert run(read_first, pieces(3), [(b"content-length", b"30")])[1] == [0]


def test_a_client_that_waits_for_100_continue_is_not_waited_for() -> None:
    headers = [(b"content-length", b"50"), (b"expect", b"100-continue")]
    assert run(answer_early, pieces(5), headers)[1] == [5]


def test_at_most_so_many_bytes_are_read() -> None:
    left, _ = run(answer_early, pieces(10), [(b"content-length", b"100")], max_bytes=25)
    assert len(left) == 7


def test_at_most_so_long_is_waited() -> None:
    started = time.monotonic()
    message = pieces(2)[:1]
    _, unread_at = run(answer_early, message, [(b"content-length", b"20")], timeout_s=0.05)
    assert unread_at == [0]
    assert time.monotonic() - started < 30


def test_a_client_that_has_gone_ends_it() -> None:
    messages = pieces(1, last="http.disconnect")
    assert run(answer_early, messages, [(b"content-length", b"90")])[1] == [0]
