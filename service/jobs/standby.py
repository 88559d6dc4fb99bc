"""One child ahead: it is started before there is a job for it, so that no job waits for a fork."""

from __future__ import annotations

from service.jobs.child import Child, ChildLostError

START_S = 120.0
"""Seconds that a child may take: before the first, the forkserver may have to compile kernels."""


class Standby:
    """Belongs to one worker thread."""

    def __init__(self) -> None:
        self._ready: Child | None = None
        self._ending: Child | None = None

    def prepare(self) -> bool:
        """Have a child ready; False when none could be started."""
        if self._ready is not None and self._ready.is_alive:
            return True
        self._discard_ready()
        try:
            child = Child()
        except ChildLostError:
            return False
        if not child.is_ready(START_S):
            child.close()
            return False
        self._ready = child
        return True

    def take(self) -> Child:
        """The child that is ready; ChildLostError when none can be had."""
        self.prepare()
        child, self._ready = self._ready, None
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
        self._discard_ready()

    def _close_ending(self) -> None:
        if self._ending is not None:
            self._ending.close()
            self._ending = None

    def _discard_ready(self) -> None:
        if self._ready is not None:
            self._ready.kill()
            self._ready.close()
            self._ready = None
