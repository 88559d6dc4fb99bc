"""An ASGI application behind real sockets, within the event loop of a test."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

from uvicorn.server import ServerState

from service.connections.guard import ConnectionGuard
from service.connections.listener import Listener, bind
from service.connections.protocol import GuardedConfig, GuardedProtocol, Timeouts


@asynccontextmanager
async def listening(
    app: Any,
    *,
    head_s: float = 5,
    stall_s: float = 5,
    idle_s: float = 5,
    guard: ConnectionGuard | None = None,
    liveness: Any = None,
) -> AsyncIterator[int]:
    """Serve the application at a free port of 127.0.0.1, and yield the port."""
    config = GuardedConfig(
        app,
        timeouts=Timeouts(head_s, stall_s),
        liveness=liveness,
        log_config=None,
        lifespan="off",
        timeout_keep_alive=idle_s,
    )
    config.load()
    state = ServerState()
    sockets = await bind("127.0.0.1", 0)
    guard = guard or ConnectionGuard(100, 100)
    listener = Listener(sockets, lambda: GuardedProtocol(config, state, {}), guard)
    listener.start()
    try:
        yield sockets[0].getsockname()[1]
    finally:
        listener.close()
        for connection in list(state.connections):
            connection.transport.abort()
        await asyncio.sleep(0)
        for task in state.tasks:
            task.cancel()
        await asyncio.gather(*state.tasks, return_exceptions=True)


async def exchange(port: int, sent: bytes, within_s: float = 10) -> bytes:
    """Send bytes and return all that comes until the connection is closed."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        writer.write(sent)
        async with asyncio.timeout(within_s):
            return await reader.read()
    except ConnectionError:
        return b""
    finally:
        writer.close()


def serve(app: Any, use: Callable[[int], Awaitable[None]], **options: Any) -> None:
    """Run a coroutine with the port of the application."""

    async def run() -> None:
        async with listening(app, **options) as port:
            await use(port)

    asyncio.run(run())
