"""Waiting for a job without holding a thread."""

from __future__ import annotations

import asyncio
import contextlib
import time

from starlette.concurrency import run_in_threadpool

from service.core import Service
from service.jobs.job import JobRow, is_terminal

LOOK_EVERY_S = 1.0  # for what nobody announces: changes by another process, the stop of this one


async def settled(service: Service, tenant: str, job_id: str, wait_s: float) -> JobRow | None:
    """The tenant's job once it has ended, or as it is after the wait; None when there is none."""
    deadline = time.monotonic() + wait_s
    with service.changes.watch(job_id, progress=False) as changed:
        while True:
            changed.clear()
            job = await run_in_threadpool(service.store.find, tenant, job_id)
            left = deadline - time.monotonic()
            over = job is None or is_terminal(job.status) or service.queue.is_stopped
            if over or left <= 0:
                return job
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(changed.wait(), min(left, LOOK_EVERY_S))
