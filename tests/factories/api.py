"""The API without a server process: an ASGI client on a runtime whose workers take no job."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import httpx
from fastapi import Request
from starlette.types import Message

import service.runtime
from service.app import create_app
from service.jobs.model import JobQueue
from service.runtime import Runtime, open_runtime
from service.settings import Settings
from service.telemetry.metrics import Metrics

XYZ = b"0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
BOUNDARY = "b0und"
Use = Callable[[httpx.AsyncClient, Runtime], Awaitable[None]]


class IdleWorkers:
    """Stands in for the WorkerPool: jobs stay queued."""

    def __init__(self, *_: object, runs_jobs: bool = True) -> None:
        self.is_ready = True
        self.failure: str | None = None
        self.is_stopping = False
        self.is_stopped = False
        self.killed: list[str] = []

    def start(self) -> None:
        """Start nothing."""

    def stop(self, grace_s: float = 0.0) -> None:
        self.is_stopping = self.is_stopped = True

    def leave(self) -> None:
        """Have nothing to leave."""

    def notify(self, queue: JobQueue) -> None:
        """Wake nobody."""

    def notify_all(self) -> None:
        """Wake nobody."""

    def held_jobs(self) -> frozenset[str]:
        return frozenset()

    def kill(self, job_id: str) -> None:
        self.killed.append(job_id)


@contextmanager
def idle_runtime(root: Path, **settings: Any) -> Iterator[Runtime]:
    """A runtime on SQLite that runs no jobs; within a running event loop."""
    with (
        mock.patch.object(service.runtime, "WorkerPool", IdleWorkers),
        open_runtime(Settings(data_dir=root, **settings), Metrics()) as runtime,
    ):
        yield runtime


@asynccontextmanager
async def api_client(
    root: Path, **settings: Any
) -> AsyncIterator[tuple[httpx.AsyncClient, Runtime]]:
    """A client of the whole ASGI application, and its runtime."""
    app = create_app(Settings(data_dir=root, **settings))
    with idle_runtime(root, **settings) as runtime:
        app.state.runtime = runtime
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            yield client, runtime


def on_api(root: Path, use: Use, **settings: Any) -> None:
    """Run a coroutine with a client of the application and its runtime."""

    async def run() -> None:
        async with api_client(root, **settings) as (client, runtime):
            await use(client, runtime)

    asyncio.run(run())


def request_of(
    chunks: Iterable[bytes], headers: dict[str, str] | None = None, *, method: str = "POST"
) -> Request:
    """A request whose body arrives in these chunks; None in place of one: the client is gone."""
    messages: list[Message] = [
        {"type": "http.disconnect"}
        if chunk is None
        else {"type": "http.request", "body": chunk, "more_body": True}
        for chunk in chunks
    ]
    messages.append({"type": "http.request", "body": b"", "more_body": False})
    scope = {
        "type": "http",
        "method": method,
        "path": "/",
        "scheme": "http",
        "query_string": b"",
        "headers": [(k.lower().encode(), v.encode()) for k, v in (headers or {}).items()],
    }

    async def receive() -> Message:
        return messages.pop(0)

    return Request(scope, receive)


def part(name: str, content: bytes, *, filename: str | None = None) -> bytes:
    """One part of a multipart body."""
    file = "" if filename is None else f'; filename="{filename}"'
    head = f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="{name}"{file}\r\n\r\n'
    return head.encode() + content + b"\r\n"


def form(*parts: bytes) -> bytes:
    """A complete multipart body."""
    return b"".join(parts) + f"--{BOUNDARY}--\r\n".encode()


FORM_TYPE = {"Content-Type": f"multipart/form-data; boundary={BOUNDARY}"}
