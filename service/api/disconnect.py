"""Waits that end when the caller is gone."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

from fastapi import Request

from service.problems import NotReadyError

T = TypeVar("T")


async def unless_disconnected(request: Request, work: Coroutine[Any, Any, T]) -> T:
    """Return the result of the work, or cancel it when the connection is closed.

    The request's body has been read, or there is none.

    Raises
    ------
    NotReadyError
        The caller is gone; nobody receives this.
    """
    task, gone = asyncio.create_task(work), asyncio.create_task(until_disconnected(request))
    try:
        await asyncio.wait({task, gone}, return_when=asyncio.FIRST_COMPLETED)
        if not task.done():
            raise NotReadyError("The connection was closed during the wait.")
        return task.result()
    finally:
        for pending in (task, gone):
            pending.cancel()
        await asyncio.gather(task, gone, return_exceptions=True)


async def until_disconnected(request: Request) -> None:
    """Wait until the connection is closed; the body has been read, or there is none."""
    while (await request.receive())["type"] != "http.disconnect":
        pass
