"""Progress and timing of a task, in the child process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from mpe_core.progress import timed
from service.workers.messages import Progress

PROGRESS_INTERVAL_S = 0.2
"""Shortest time between two messages within a stage: each one is a write to the database."""


class ProgressReport:
    """Sends the progress of a task and keeps the seconds of its stages.

    Parameters
    ----------
    send : callable
        Sends one message to the parent.

    Attributes
    ----------
    timing : dict
        Seconds by stage; the keys are those of the API, such as `decode_s`.
    """

    def __init__(self, send: Callable[[Progress], None]) -> None:
        self.timing: dict[str, float] = {}
        self._send = send
        self._last = Progress("", 0.0)
        self._last_time = 0.0

    def send(self, stage: str, fraction: float) -> None:
        """Send what is new: each change of stage, and every PROGRESS_INTERVAL_S the fraction."""
        now, new = time.monotonic(), Progress(stage, min(1.0, max(0.0, fraction)))
        is_due = stage != self._last.stage or now - self._last_time >= PROGRESS_INTERVAL_S
        if is_due and new != self._last:
            self._last, self._last_time = new, now
            self._send(new)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a stage."""
        with timed(self.timing, f"{name}_s"):
            yield
