"""Notification of those who wait for a job: listeners of the store, coroutines of the API."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Protocol

from service.jobs.model import JobRow


class JobListener(Protocol):
    """Told of each change of a job, once the change can be read; called from any thread."""

    def changed(self, job_id: str) -> None:
        """React to a change after which the job has not ended."""

    def ended(self, job: JobRow) -> None:
        """React to the end of a job."""


class JobNotifier:
    """A JobListener that wakes coroutines of the event loop in which it was made."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._watchers: dict[tuple[str, bool], set[asyncio.Event]] = defaultdict(set)

    def changed(self, job_id: str) -> None:
        """Wake those who watch every change of the job."""
        self._wake_soon([(job_id, False)])

    def ended(self, job: JobRow) -> None:
        """Wake all who watch the job."""
        self._wake_soon([(job.id, False), (job.id, True)])

    def wake(self, job_id: str, *, has_ended: bool) -> None:
        """Wake those who watch the job, which another process has changed."""
        keys = [(job_id, False), (job_id, True)] if has_ended else [(job_id, False)]
        self._wake_soon(keys)

    def wake_all(self) -> None:
        """Wake all watchers of all jobs, because nothing will change any more."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(lambda: self._wake(list(self._watchers)))

    @contextmanager
    def watch(self, job_id: str, *, only_end: bool) -> Iterator[asyncio.Event]:
        """Yield an event that is set at each change of the job, or only at its end."""
        event, key = asyncio.Event(), (job_id, only_end)
        self._watchers[key].add(event)
        try:
            yield event
        finally:
            self._watchers[key].remove(event)
            if not self._watchers[key]:
                del self._watchers[key]

    def _wake_soon(self, keys: list[tuple[str, bool]]) -> None:
        # who begins to watch after this check reads the change itself
        if not self._loop.is_closed() and any(key in self._watchers for key in keys):
            self._loop.call_soon_threadsafe(self._wake, keys)

    def _wake(self, keys: Iterable[tuple[str, bool]]) -> None:
        for key in keys:
            for event in self._watchers.get(key, ()):
                event.set()
