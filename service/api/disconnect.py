"""Callers that are gone: waits that end then, and errors that say no more than that."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

from anyio import BrokenResourceError
from fastapi import Request

from service.problems import ConnectionClosedError

T = TypeVar("T")


async def unless_disconnected(request: Request, work: Coroutine[Any, Any, T]) -> T:
    """Return the result of the work, or cancel it when the connection is closed.

    The request's body has been read, or there is none.

    Raises
    ------
    ConnectionClosedError
        The caller is gone.
    """
    task, gone = asyncio.create_task(work), asyncio.create_task(until_disconnected(request))
    try:
        await asyncio.wait({task, gone}, return_when=asyncio.FIRST_COMPLETED)
        if not task.done():
            raise ConnectionClosedError("The connection was closed during the wait.")
        return task.result()
    finally:
        for pending in (task, gone):
            pending.cancel()
        await asyncio.gather(task, gone, return_exceptions=True)


async def until_disconnected(request: Request) -> None:
    """Wait until the connection is closed; the body has been read, or there is none."""
    while (await request.receive())["type"] != "http.disconnect":
        pass


def is_disconnect(error: Exception) -> bool:
    """Return whether the error is only that the caller has left a stream of events."""
    if not isinstance(error, ExceptionGroup):
        return False
    return error.split(BrokenResourceError)[1] is None
