"""Whether the service can take on more, asked before a body is read."""

from __future__ import annotations

import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import psutil
from fastapi import Request
from starlette.concurrency import run_in_threadpool

from service.auth.authenticator import Caller
from service.jobs.accept import check_queue_limit, check_tenant_queue_limit
from service.problems import NotReadyError, OverloadedError
from service.runtime import Runtime


@asynccontextmanager
async def reserve_body_bytes(
    request: Request, service: Runtime, caller: Caller
) -> AsyncIterator[None]:
    """Room for the request's body while the context lasts; raises like `admit`.

    A body that does not announce its length may be as long as any.
    """
    longest = service.settings.max_body_bytes
    size = min(longest, int(request.headers.get("content-length", longest)))
    await run_in_threadpool(admit, service, caller, size)
    try:
        yield
    finally:
        service.storage_quota.release(caller, size)


def admit(service: Runtime, caller: Caller, size: int) -> None:
    """Reserve room for so many bytes, which the caller releases.

    NotReadyError, QueueFullError, QuotaExceededError or OverloadedError when a submission would
    come to nothing.
    """
    settings = service.settings
    if service.workers.is_stopping:
        raise NotReadyError("The service is stopping; retry later.")
    check_queue_limit(service.jobs.count("queued"), settings.queue_limit)
    if caller.limits.queue_limit is not None:
        check_tenant_queue_limit(
            service.jobs.count("queued", caller.tenant), caller.limits.queue_limit
        )
    if shutil.disk_usage(settings.data_dir).free < settings.min_free_disk_bytes:
        raise _overloaded("disk")
    if psutil.virtual_memory().available < settings.min_free_memory_bytes:
        raise _overloaded("memory")
    service.storage_quota.reserve(caller, size)


def _overloaded(resource: str) -> OverloadedError:
    return OverloadedError(f"Too little {resource} is left; retry later.")
