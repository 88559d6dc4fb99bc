"""Threads of one kind of call, apart from those that all routes share."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TypeVar
from weakref import WeakKeyDictionary

from anyio import CapacityLimiter, to_thread

T = TypeVar("T")
THREADS = 8
"""Threads that all routes share: more of them keep the event loop waiting for the interpreter
(docs/tuning.md, service.api)."""
WAITING_THREADS = 40
"""The same where database or files are on other machines: most of them wait for those."""


def limit_threads(*, waits_for_others: bool) -> None:
    """Bound the threads of the running event loop that all routes share."""
    limiter = to_thread.current_default_thread_limiter()
    limiter.total_tokens = WAITING_THREADS if waits_for_others else THREADS


class OwnThreads:
    """At most `count` threads at once; calls wait for each other, and for no other call.

    Parameters
    ----------
    count : int
        Threads of one event loop.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._limiters: WeakKeyDictionary[asyncio.AbstractEventLoop, CapacityLimiter] = (
            WeakKeyDictionary()
        )

    async def run(self, function: Callable[[], T], *, abandon: bool = False) -> T:
        """Call the function in a thread; `abandon` leaves it there when the caller is cancelled."""
        loop = asyncio.get_running_loop()
        limiter = self._limiters.setdefault(loop, CapacityLimiter(self._count))
        return await to_thread.run_sync(function, limiter=limiter, abandon_on_cancel=abandon)


STORING = OwnThreads(THREADS)
"""Threads that make files durable, which a slow disk may take seconds for: other calls go on."""
