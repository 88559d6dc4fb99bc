"""Tells coroutines that a job has changed, from any thread."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Announce(Protocol):
    """Tells that a job has changed, or only that it has got further."""

    def __call__(self, job_id: str, *, progress: bool = False) -> None: ...


class JobNotifier:
    """Belongs to the event loop in which it was made."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._watchers: dict[tuple[str, bool], set[asyncio.Event]] = defaultdict(set)

    def announce(self, job_id: str, *, progress: bool = False) -> None:
        """Wake whoever watches the job, for mere progress those who want to know of it; may be
        called from any thread, once the change can be read.

        The loop is not troubled where nobody watches: who begins to later reads the change.
        """
        told = [(job_id, True)] if progress else [(job_id, True), (job_id, False)]
        if not self._loop.is_closed() and any(key in self._watchers for key in told):
            self._loop.call_soon_threadsafe(self._wake, told)

    def announce_stop(self) -> None:
        """Wake all: nothing will change any more; may be called from any thread."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(lambda: self._wake(list(self._watchers)))

    @contextmanager
    def watch(self, job_id: str, *, progress: bool) -> Iterator[asyncio.Event]:
        """An event that is set at each change while the context lasts, of mere progress if that is
        wanted."""
        event, key = asyncio.Event(), (job_id, progress)
        self._watchers[key].add(event)
        try:
            yield event
        finally:
            self._watchers[key].remove(event)
            if not self._watchers[key]:
                del self._watchers[key]

    def _wake(self, told: list[tuple[str, bool]]) -> None:
        for key in told:
            for event in self._watchers.get(key, ()):
                event.set()
