"""How requests are sent: blocking, or on an event loop; everything above is written once.

The core of the client is written as coroutines over a `Transport`. Those of `BlockingTransport`
never suspend, so that `run_blocking` can run the same core without an event loop.
"""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Callable, Coroutine
from typing import Any, Protocol, TypeVar

import anyio
import httpx

Value = TypeVar("Value")

CANCEL_S = 10.0
"""Seconds that the cancellation of a registration may take after a task was cancelled."""


class Transport(Protocol):
    """What the core of the client needs of a connection."""

    @property
    def client(self) -> httpx.Client | httpx.AsyncClient:
        """The HTTP client, which builds requests."""

    async def send(self, request: httpx.Request, *, stream: bool) -> httpx.Response:
        """Send a request; with `stream` the body is read later."""

    def iter_lines(self, response: httpx.Response) -> AsyncIterator[str]:
        """Yield the lines of a body that is streamed."""

    def iter_bytes(self, response: httpx.Response) -> AsyncIterator[bytes]:
        """Yield the body that is streamed."""

    async def read(self, response: httpx.Response) -> bytes:
        """Read a body that is streamed, whole."""

    async def close(self, response: httpx.Response) -> None:
        """End a response whose body is streamed."""

    async def sleep(self, seconds: float) -> None:
        """Wait."""

    async def finish(self, work: Callable[[], Coroutine[Any, Any, object]]) -> None:
        """Do what has to be done although the caller was interrupted."""


class BlockingTransport:
    """Transport that blocks its thread."""

    def __init__(self, client: httpx.Client) -> None:
        self.client = client

    async def send(self, request: httpx.Request, *, stream: bool) -> httpx.Response:
        """Send a request."""
        return self.client.send(request, stream=stream)

    async def iter_lines(self, response: httpx.Response) -> AsyncIterator[str]:
        """Yield the lines."""
        for line in response.iter_lines():
            yield line

    async def iter_bytes(self, response: httpx.Response) -> AsyncIterator[bytes]:
        """Yield the body."""
        for piece in response.iter_bytes():
            yield piece

    async def read(self, response: httpx.Response) -> bytes:
        """Read the body."""
        return response.read()

    async def close(self, response: httpx.Response) -> None:
        """End a response."""
        response.close()

    async def sleep(self, seconds: float) -> None:
        """Wait."""
        time.sleep(seconds)

    async def finish(self, work: Callable[[], Coroutine[Any, Any, object]]) -> None:
        """Do it."""
        await work()


class AsyncTransport:
    """Transport on an event loop, asyncio's or trio's."""

    def __init__(self, client: httpx.AsyncClient) -> None:
        self.client = client

    async def send(self, request: httpx.Request, *, stream: bool) -> httpx.Response:
        """Send a request."""
        return await self.client.send(request, stream=stream)

    def iter_lines(self, response: httpx.Response) -> AsyncIterator[str]:
        """Yield the lines."""
        return response.aiter_lines()

    def iter_bytes(self, response: httpx.Response) -> AsyncIterator[bytes]:
        """Yield the body."""
        return response.aiter_bytes()

    async def read(self, response: httpx.Response) -> bytes:
        """Read the body."""
        return await response.aread()

    async def close(self, response: httpx.Response) -> None:
        """End a response."""
        await response.aclose()

    async def sleep(self, seconds: float) -> None:
        """Wait."""
        await anyio.sleep(seconds)

    async def finish(self, work: Callable[[], Coroutine[Any, Any, object]]) -> None:
        """Do it, shielded from the cancellation of the task, for CANCEL_S at most."""
        with anyio.move_on_after(CANCEL_S, shield=True):
            await work()


def run_blocking(work: Coroutine[Any, Any, Value]) -> Value:
    """Run a coroutine over a `BlockingTransport` to its end."""
    try:
        work.send(None)
    except StopIteration as end:
        value: Value = end.value
        return value
    work.close()
    raise RuntimeError("a blocking transport suspended: use AsyncClient on an event loop")


async def take_next(items: AsyncIterator[Value]) -> Value | None:
    """Return the next item; None at the end."""
    return await anext(items, None)
