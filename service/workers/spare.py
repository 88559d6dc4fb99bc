"""One child ahead: it is started before there is a job for it, so that no job waits for a fork."""

from __future__ import annotations

import contextlib

from service.workers.child import Child, ChildLostError

START_S = 120.0
"""Seconds that a child may take: before the first, the forkserver may have to compile kernels."""


class SpareChild:
    """Belongs to one worker thread."""

    def __init__(self) -> None:
        self._next: Child | None = None
        self._ending: Child | None = None

    def begin(self) -> None:
        """Start the next child, unless it is there; it gets ready by itself."""
        if self._next is None or not self._next.is_alive:
            self._discard_next()
            with contextlib.suppress(ChildLostError):
                self._next = Child()

    def is_ready(self) -> bool:
        """Whether the next child is there and ready; waits for it."""
        self.begin()
        if self._next is not None and not self._next.is_ready(START_S):
            self._discard_next()
        return self._next is not None

    def take(self) -> Child:
        """The next child, ready; ChildLostError when none can be had."""
        self.is_ready()
        child, self._next = self._next, None
        if child is None:
            raise ChildLostError("no process could be started")
        return child

    def let_end(self, child: Child) -> None:
        """Close a child that is about to end by itself, later: the system takes its time."""
        self._close_ending()
        self._ending = child

    def close(self) -> None:
        """Give up all children."""
        self._close_ending()
        self._discard_next()

    def _close_ending(self) -> None:
        if self._ending is not None:
            self._ending.close()
            self._ending = None

    def _discard_next(self) -> None:
        if self._next is not None:
            self._next.kill()
            self._next.close()
            self._next = None
