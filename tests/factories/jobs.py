"""Jobs for the tests: rows to add, and the transitions that they go through."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any
from uuid import uuid4

from service.clouds.inputs import CloudInput
from service.database.engine import Database
from service.jobs.model import JobQueue, JobRow, Outcome, Retention
from service.jobs.notifier import JobListener
from service.jobs.transitions import JobTransitions

CLOUD = CloudInput(sha256="ab", size=1)
OUTCOME = Outcome("result", "inliers", 100, 0.9, CLOUD, CLOUD, {"search_s": 1.0}, ["odd"])
TENANT = "lab"
LEASE_S = 30.0


def open_transitions(
    database: Database,
    *listeners: JobListener,
    queue_limit: int = 100,
    is_stored: Callable[[str], bool] = lambda sha256: True,
    large_bytes: int | None = None,
) -> JobTransitions:
    """Transitions of jobs that are kept for a minute or two; all blobs are on the disk."""
    retention = Retention(result_s=60, job_s=120)
    return JobTransitions(
        database,
        queue_limit=queue_limit,
        retention=retention,
        is_stored=is_stored,
        large_bytes=large_bytes,
        listeners=listeners,
    )


def new_job(**values: Any) -> JobRow:
    """A queued job of TENANT with the given fields."""
    defaults = {"options": {"seed": 1}, "created_at": time.time(), "tenant": TENANT}
    defaults |= {"source": CLOUD, "target": CLOUD}
    return JobRow(id=str(uuid4()), **(defaults | values))


def add(transitions: JobTransitions, **values: Any) -> JobRow:
    """Add a new job with the given fields."""
    return transitions.add(new_job(**values))


def claim(
    transitions: JobTransitions, queue: JobQueue = "register", *, lease_s: float = LEASE_S
) -> JobRow:
    """Claim the next job of a queue, which must exist."""
    job = transitions.claim(queue, lease_s=lease_s)
    assert job is not None
    return job
