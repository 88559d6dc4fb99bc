"""A child process of whom the test decides what it says, for the supervision of attempts."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from service.schemas.inlier_file import INLIER_DTYPE
from service.schemas.result import InlierSummary, Result, Rotation
from service.workers.child import ChildLostError, NoProcessError
from service.workers.messages import Message
from service.workers.register_clouds import INLIERS_NAME, RESULT_NAME
from service.workers.task import Task

Line = Message | Exception | Callable[[], object]
"""A message to send, an exception to raise, or a call to make before the next line."""


class FakeChild:
    """Says its lines, one at each `receive`; silent when there are none left.

    `files` are what it has written to its scratch folder when it says its first line.
    """

    def __init__(self, *lines: Line, files: Mapping[str, bytes] | None = None) -> None:
        self._lines = list(lines)
        self._files = files or {}
        self.task: Task | None = None
        self.is_killed = False
        self.is_closed = False

    def wait_until_ready(self, timeout_s: float = 0.0) -> bool:
        return True

    def send_task(self, task: Task) -> None:
        if self.is_killed:
            raise ChildLostError("its process was ended by SIGKILL")
        self.task = task
        for name, content in self._files.items():
            (task.environment.scratch / name).write_bytes(content)

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


def result_files() -> dict[str, bytes]:
    """Make the files of a registration as its child leaves them: a result and two pairs."""
    zeros = [[0.0] * 6 for _ in range(6)]
    result = Result(
        scale=1.0,
        scale_deviation=0.0,
        warnings=[],
        transform=np.eye(4).tolist(),
        rotation=Rotation(quaternion_xyzw=[0.0, 0.0, 0.0, 1.0], angle_deg=0.0),
        translation=[0.0, 0.0, 0.0],
        overlap=1.0,
        rmse=0.0,
        energy=0.0,
        confidence=0.9,
        accepted=True,
        ambiguous=False,
        alternatives=[],
        covariance=zeros,
        free_directions=[],
        converged=True,
        iterations=1,
        inliers=InlierSummary(count=2, ratio=1.0, threshold=0.1, pairs=[[0, 0], [1, 1]]),
    )
    pairs = io.BytesIO()
    np.save(pairs, np.zeros(2, INLIER_DTYPE))
    return {
        RESULT_NAME: result.model_dump_json().encode(),
        INLIERS_NAME: pairs.getvalue(),
    }
