"""A thread that calls the clean-up tasks of a service at regular intervals."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence

log = logging.getLogger(__name__)

MaintenanceTask = Callable[[], object]


class Maintenance:
    """A thread that calls all tasks, in order, every `interval_s` seconds."""

    def __init__(self, tasks: Sequence[MaintenanceTask], interval_s: float) -> None:
        self._tasks = tasks
        self._interval_s = interval_s
        self._failing: set[MaintenanceTask] = set()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="maintenance", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread after the task that is running."""
        self._stopping.set()
        self._thread.join()

    def run_once(self) -> None:
        """Call every task; log one that begins to fail and go on with the next."""
        for task in self._tasks:
            try:
                task()
            except Exception:
                if task not in self._failing:
                    log.exception("a maintenance task failed; it is called again at its next turn")
                self._failing.add(task)
            else:
                self._failing.discard(task)

    def _run(self) -> None:
        while not self._stopping.wait(self._interval_s):
            self.run_once()
