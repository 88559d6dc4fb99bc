"""Jobs that wait for workers of which none is there, told to whoever looks after the service."""

from __future__ import annotations

import logging
from typing import get_args

from service.jobs.model import JobQueue
from service.jobs.queries import JobQueries
from service.jobs.sizes import needed_label
from service.jobs.worker_slots import WorkerSlots

log = logging.getLogger(__name__)


class MissingWorkers:
    """Looks which queued jobs no worker of any service can run."""

    def __init__(self, jobs: JobQueries, slots: WorkerSlots) -> None:
        self._jobs = jobs
        self._slots = slots
        self._told: set[JobQueue] = set()

    def count(self) -> dict[JobQueue, int]:
        """Return the number of queued jobs of each queue that no worker claims from."""
        queues: tuple[JobQueue, ...] = get_args(JobQueue)
        slots = {label: self._slots.count(label) for label in set(map(needed_label, queues))}
        unserved = [queue for queue in queues if not slots[needed_label(queue)]]
        counts = {queue: self._jobs.count_waiting(queue) for queue in unserved}
        return {queue: number for queue, number in counts.items() if number}

    def describe(self) -> list[str]:
        """Return a sentence for each such queue: how many wait for what, and what to do."""
        return [_describe(queue, number) for queue, number in self.count().items()]

    def log(self) -> None:
        """Log a warning for each queue that has become one of them since the last call."""
        counts = self.count()
        for queue in counts.keys() - self._told:
            log.warning(_describe(queue, counts[queue]))
        self._told = set(counts)


def _describe(queue: JobQueue, number: int) -> str:
    label = needed_label(queue)
    if label is None:
        return f"{number} registrations wait, and no worker is running: start `mpe worker`."
    return (
        f"{number} registrations wait for a worker with the label {label}, and none is running: "
        f"start `mpe worker --labels {label}`."
    )
