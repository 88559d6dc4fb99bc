"""A thread that calls the clean-up tasks of a service at regular intervals."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping

from service.problems import NotReadyError, is_disk_full

log = logging.getLogger(__name__)

STOP_S = 5.0
"""Time that the task that is running has to end, in seconds."""
MaintenanceTask = Callable[[], object]


class Maintenance:
    """A thread that calls all tasks, in order, every `interval_s` seconds.

    Parameters
    ----------
    tasks : mapping
        Tasks by the names that the log tells where one fails.
    interval_s : float
        Seconds between two rounds.
    """

    def __init__(self, tasks: Mapping[str, MaintenanceTask], interval_s: float) -> None:
        self._tasks = tasks
        self._interval_s = interval_s
        self._failing: set[str] = set()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="maintenance", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread after the task that is running, or leave it where that takes long."""
        self._stopping.set()
        self._thread.join(STOP_S)

    def run_once(self) -> None:
        """Call every task; log one that begins to fail and go on with the next."""
        for name, task in self._tasks.items():
            try:
                task()
            except Exception as error:  # noqa: BLE001
                if name not in self._failing:
                    _log_failure(name, error)
                self._failing.add(name)
            else:
                self._failing.discard(name)

    def _run(self) -> None:
        while not self._stopping.wait(self._interval_s):
            self.run_once()


def _log_failure(name: str, error: Exception) -> None:
    """Log why a task failed: with a traceback, unless it waits for the store or the disk."""
    is_expected = isinstance(error, NotReadyError) or is_disk_full(error)
    log.log(
        logging.WARNING if is_expected else logging.ERROR,
        "the maintenance task %r failed, and is called again at its next turn: %r",
        name,
        error,
        exc_info=None if is_expected else error,
    )
