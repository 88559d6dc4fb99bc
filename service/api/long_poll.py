"""Waiting for a job without holding a thread."""

from __future__ import annotations

import asyncio
import contextlib
import time

from starlette.concurrency import run_in_threadpool

from service.jobs.model import JobRow, is_terminal
from service.runtime import Runtime

SHARED_LOOK_S = 1.0
LOOK_S = 15.0
"""Every change of this process is announced: a look without one is for what was forgotten. 64 waits
that looked every second took 4 % of a core."""


def poll_interval_s(service: Runtime) -> float:
    """So long may a change be missed that nobody announces: one by another service on the same
    database."""
    return SHARED_LOOK_S if service.database.is_shared else LOOK_S


async def wait_until_ended(
    service: Runtime, tenant: str, job_id: str, wait_s: float
) -> JobRow | None:
    """The tenant's job once it has ended, or as it is after the wait; None when there is none."""
    deadline, look_s = time.monotonic() + wait_s, poll_interval_s(service)
    with service.changes.watch(job_id, progress=False) as changed:
        while True:
            changed.clear()
            job = await run_in_threadpool(service.store.find, tenant, job_id)
            left = deadline - time.monotonic()
            over = job is None or is_terminal(job.status) or service.queue.is_stopped
            if over or left <= 0:
                return job
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(changed.wait(), min(left, look_s))
