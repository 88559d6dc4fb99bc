"""A child process of whom the test decides what it says, for the supervision of attempts."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from service.workers.child import ChildLostError, NoProcessError
from service.workers.messages import Message
from service.workers.task import Task

Line = Message | Exception | Callable[[], object]
"""A message to send, an exception to raise, or a call to make before the next line."""


class FakeChild:
    """Says its lines, one at each `receive`; silent when there are none left."""

    def __init__(self, *lines: Line) -> None:
        self._lines = list(lines)
        self.task: Task | None = None
        self.is_killed = False
        self.is_closed = False

    def wait_until_ready(self, timeout_s: float = 0.0) -> bool:
        return True

    def send_task(self, task: Task) -> None:
        if self.is_killed:
            raise ChildLostError("its process was ended by SIGKILL")
        self.task = task

    def receive(self, timeout_s: float) -> Message | None:
        if self.is_killed:
            raise ChildLostError("its process was ended by SIGKILL")
        if not self._lines:
            time.sleep(min(timeout_s, 0.01))
            return None
        line = self._lines.pop(0)
        if isinstance(line, Exception):
            raise line
        if callable(line):
            line()
            return None
        return line

    def kill(self) -> None:
        self.is_killed = True

    def close(self) -> None:
        assert self.is_killed
        self.is_closed = True


class FakeSpare:
    """Gives out children in order; each must be given back or closed."""

    def __init__(self, children: Sequence[FakeChild]) -> None:
        self._waiting = list(children)
        self.children = list(children)
        self.starts = 0

    def start(self) -> None:
        self.starts += 1

    def take(self) -> FakeChild:
        if not self._waiting:
            raise NoProcessError("no process could be started")
        return self._waiting.pop(0)

    def close_later(self, child: FakeChild) -> None:
        child.close()
