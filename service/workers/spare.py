"""A spare child process, started ahead of need, so that no task waits for a fork."""

from __future__ import annotations

from service.workers.child import START_TIMEOUT_S, Child, NoProcessError


class SpareChild:
    """The next child of one thread, and the last one while it ends."""

    def __init__(self) -> None:
        self._next: Child | None = None
        self._ending: Child | None = None

    def start(self) -> None:
        """Start the next child unless there is one; do not wait until it is ready."""
        if self._next is None or not self._next.is_alive:
            self._discard_next()
            self._next = Child()

    def wait_until_ready(self, timeout_s: float) -> bool:
        """Start the next child if needed, and return whether it is ready within the time.

        Raises
        ------
        NoProcessError
            It could not be started.
        """
        self.start()
        assert self._next is not None  # noqa: S101
        try:
            return self._next.wait_until_ready(timeout_s)
        except NoProcessError:
            self._discard_next()
            raise

    def take(self) -> Child:
        """Return the next child once it is ready.

        Raises
        ------
        NoProcessError
            No child could be started.
        """
        if not self.wait_until_ready(START_TIMEOUT_S):
            self._discard_next()
            raise NoProcessError(f"a process was not ready after {START_TIMEOUT_S:g} s")
        child, self._next = self._next, None
        assert child is not None  # noqa: S101
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
