"""What is done from time to time: expired leases, deadlines, results, jobs and files."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence

log = logging.getLogger(__name__)

Task = Callable[[], object]


class Maintenance:
    """A thread that calls all tasks, in their order, every `interval_s` seconds."""

    def __init__(self, tasks: Sequence[Task], interval_s: float) -> None:
        self._tasks = tasks
        self._interval_s = interval_s
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="maintenance", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread once the task under way has ended."""
        self._stopping.set()
        self._thread.join()

    def run_once(self) -> None:
        """Call every task; one that fails is logged and keeps no other from its turn."""
        for task in self._tasks:
            try:
                task()
            except Exception:
                log.exception("a maintenance task failed; it is called again in its turn")

    def _run(self) -> None:
        while not self._stopping.wait(self._interval_s):
            self.run_once()
