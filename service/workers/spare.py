"""A spare child process, started ahead of need, so that no task waits for a fork."""

from __future__ import annotations

import contextlib

from service.workers.child import Child, ChildLostError


class SpareChild:
    """The next child of one thread, and the last one while it ends."""

    def __init__(self) -> None:
        self._next: Child | None = None
        self._ending: Child | None = None

    def start(self) -> None:
        """Start the next child unless there is one; do not wait until it is ready."""
        if self._next is None or not self._next.is_alive:
            self._discard_next()
            with contextlib.suppress(ChildLostError):
                self._next = Child()

    def is_ready(self) -> bool:
        """Start the next child if needed, wait for it, and return whether it is ready."""
        self.start()
        if self._next is not None and not self._next.wait_until_ready():
            self._discard_next()
        return self._next is not None

    def take(self) -> Child:
        """Return the next child once it is ready.

        Raises
        ------
        ChildLostError
            No child could be started.
        """
        self.is_ready()
        child, self._next = self._next, None
        if child is None:
            raise ChildLostError("no process could be started")
        return child

    def close_later(self, child: Child) -> None:
        """Close a child that is ending by itself when the next one is handed in: that takes time.

        See Also
        --------
        close : closes it as well.
        """
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
