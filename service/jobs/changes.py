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


class Changes:
    """Belongs to the event loop in which it was made."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._watchers: dict[str, dict[asyncio.Event, bool]] = defaultdict(dict)

    def announce(self, job_id: str, *, progress: bool = False) -> None:
        """Wake whoever watches the job, for mere progress those who want to know of it; may be
        called from any thread."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._wake, job_id, progress)

    @contextmanager
    def watch(self, job_id: str, *, progress: bool) -> Iterator[asyncio.Event]:
        """An event that is set at each change while the context lasts, of mere progress if that is
        wanted: a job tells of it some twenty times."""
        event = asyncio.Event()
        self._watchers[job_id][event] = progress
        try:
            yield event
        finally:
            del self._watchers[job_id][event]
            if not self._watchers[job_id]:
                del self._watchers[job_id]

    def _wake(self, job_id: str, progress: bool) -> None:
        for event, wants_progress in self._watchers.get(job_id, {}).items():
            if wants_progress or not progress:
                event.set()
