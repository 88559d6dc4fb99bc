"""Waiting for a job to end without holding a thread (`Prefer: wait`)."""

from __future__ import annotations

import asyncio
import contextlib
import time

from starlette.concurrency import run_in_threadpool

from service.jobs.model import JobRow, is_terminal
from service.runtime import Runtime


async def wait_until_ended(
    runtime: Runtime, tenant: str, job_id: str, timeout_s: float
) -> JobRow | None:
    """Wait until a job has ended or the service stops, for at most `timeout_s` seconds.

    Returns
    -------
    JobRow or None
        The job as it is then; None if the tenant has no such job.
    """
    deadline, poll_s = time.monotonic() + timeout_s, runtime.database.poll_interval_s
    with runtime.notifier.watch(job_id, only_end=True) as changed:
        while True:
            changed.clear()
            job = await run_in_threadpool(runtime.jobs.get, tenant, job_id)
            remaining_s = deadline - time.monotonic()
            if job is None or is_terminal(job.status) or runtime.workers.is_stopped:
                return job
            if remaining_s <= 0:
                return job
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(changed.wait(), min(remaining_s, poll_s))
