"""/livez, /readyz, /metrics and /v1/capacity: probes, measurements, load."""

from __future__ import annotations

import asyncio
from functools import partial

from fastapi import APIRouter, Depends, Response
from fastapi.responses import PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST

from service.api.dependencies import CurrentCaller, CurrentRuntime, identify
from service.api.threads import OwnThreads
from service.problems import NotReadyError, OverloadedError
from service.runtime import Runtime
from service.schemas import Capacity, Health, Readiness, TenantUsage

router = APIRouter(tags=["health"])

ANSWER_S = 2.0
"""Time that database and disk have to answer a probe, in seconds; probes give up after 3 to 5 s."""
_PROBES = OwnThreads(2)


@router.get("/livez", operation_id="getLiveness", summary="Is the process alive?")
async def livez() -> Health:
    """Return 200 as long as the process responds."""
    return Health()


@router.get("/readyz", operation_id="getReadiness", summary="Do registrations start at once?")
async def readyz(runtime: CurrentRuntime) -> Readiness:
    """Return 200 when workers, database and disk are ready, and 503 otherwise or while stopping."""
    if not runtime.workers.is_ready:
        reason = runtime.workers.failure or "they are starting, or the service is stopping"
        raise NotReadyError(f"The workers are not ready: {reason}. Retry later.", retry_after_s=1)
    try:
        async with asyncio.timeout(ANSWER_S):
            return await _PROBES.run(partial(_look, runtime), abandon=True)
    except TimeoutError:
        raise NotReadyError("The database or the disk does not answer; retry later.") from None


def _look(runtime: Runtime) -> Readiness:
    """Look at disk and database, either of which may hang."""
    if runtime.disk.is_short:
        raise OverloadedError("Too little disk is left; retry later.")
    return Readiness(warnings=runtime.missing_workers.describe())


@router.get(
    "/metrics",
    operation_id="getMetrics",
    summary="Measurements for Prometheus",
    response_class=PlainTextResponse,
    dependencies=[Depends(identify)],
)
def metrics(runtime: CurrentRuntime) -> Response:
    """Return all metrics in Prometheus' text format."""
    return Response(runtime.telemetry.metrics.exposition(), media_type=CONTENT_TYPE_LATEST)


@router.get("/v1/capacity", operation_id="getCapacity", summary="How much can be taken on?")
def capacity(runtime: CurrentRuntime, caller: CurrentCaller) -> Capacity:
    """Return workers, queue, limits, and the usage of the caller's tenant."""
    settings, limits = runtime.settings, caller.limits
    fetching = runtime.jobs.count("running", queue="fetch")
    running, workers = runtime.jobs.count("running") - fetching, runtime.slots.count()
    return Capacity(
        workers=workers,
        labels=runtime.slots.count_by_label(),
        threads_per_worker=settings.threads,
        running=running,
        free=max(0, workers - running),
        queued=runtime.jobs.count("queued"),
        queue_limit=settings.queue_limit,
        warnings=runtime.missing_workers.describe(),
        large_bytes=settings.large_bytes,
        max_body_bytes=settings.max_body_bytes,
        max_wait_s=settings.max_wait_s,
        job_timeout_s=settings.job_timeout_s,
        job_memory_bytes=settings.job_memory_bytes,
        share=TenantUsage(
            requests_per_s=limits.requests_per_s,
            queued=runtime.jobs.count("queued", caller.tenant),
            queue_limit=limits.queue_limit,
            stored_bytes=runtime.storage_quota.used(caller.tenant),
            stored_bytes_limit=limits.stored_bytes,
        ),
    )
