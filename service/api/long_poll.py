"""Waiting for a job without holding a thread."""

from __future__ import annotations

import asyncio
import contextlib
import time

from starlette.concurrency import run_in_threadpool

from service.jobs.model import JobRow, is_terminal
from service.runtime import Runtime


async def wait_until_ended(
    service: Runtime, tenant: str, job_id: str, wait_s: float
) -> JobRow | None:
    """The tenant's job once it has ended, or as it is after the wait; None when there is none."""
    deadline, poll_s = time.monotonic() + wait_s, service.database.poll_interval_s
    with service.notifier.watch(job_id, only_end=True) as changed:
        while True:
            changed.clear()
            job = await run_in_threadpool(service.jobs.get, tenant, job_id)
            left = deadline - time.monotonic()
            over = job is None or is_terminal(job.status) or service.workers.is_stopped
            if over or left <= 0:
                return job
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(changed.wait(), min(left, poll_s))
