"""Which queue a job waits in: large clouds go to workers with the label LARGE alone."""

from __future__ import annotations

from typing import get_args

from service.jobs.model import JobQueue, JobRow

LARGE = "large"
"""Label of the workers that have the memory for large clouds."""


def choose_queue(job: JobRow, large_bytes: int | None) -> JobQueue:
    """Return the queue of a job that is accepted, or whose clouds have been fetched.

    Parameters
    ----------
    large_bytes : int, optional
        Clouds are large whose files have more bytes together; None: none are.
    """
    if job.source.needs_fetching or job.target.needs_fetching:
        return "fetch"
    size = (job.source.size or 0) + (job.target.size or 0)
    return "large" if large_bytes is not None and size > large_bytes else "register"


def needed_label(queue: JobQueue) -> str | None:
    """Return the label that a worker must have to claim from the queue; None: any worker may."""
    return LARGE if queue == "large" else None


def served_queues(labels: tuple[str, ...]) -> list[JobQueue]:
    """Return the queues that workers with these labels register clouds of, in their order.

    What they alone can do goes first.
    """
    queues: tuple[JobQueue, ...] = get_args(JobQueue)
    served = [queue for queue in queues if queue != "fetch"]
    allowed = [queue for queue in served if needed_label(queue) in (None, *labels)]
    return sorted(allowed, key=lambda queue: needed_label(queue) is None)
