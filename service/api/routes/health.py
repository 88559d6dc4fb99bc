"""/livez, /readyz, /metrics and /v1/capacity."""

from __future__ import annotations

from fastapi import APIRouter, Depends, Response
from fastapi.responses import PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST

from service.api.dependencies import CurrentCaller, CurrentService, identify
from service.problems import NotReadyError
from service.schemas import Capacity, Health, Share

router = APIRouter(tags=["health"])


@router.get("/livez", operation_id="getLiveness", summary="Is the process alive?")
def livez() -> Health:
    """200 as long as the process answers at all."""
    return Health()


@router.get("/readyz", operation_id="getReadiness", summary="Do registrations start at once?")
def readyz(service: CurrentService) -> Health:
    """200 when the workers are warm and the store answers; 503 also while the service stops."""
    if not service.workers.is_ready:
        raise NotReadyError("The workers are not ready; retry later.", retry_after_s=1)
    service.jobs.count("queued")
    return Health()


@router.get(
    "/metrics",
    operation_id="getMetrics",
    summary="Measurements for Prometheus",
    response_class=PlainTextResponse,
    dependencies=[Depends(identify)],
)
def metrics(service: CurrentService) -> Response:
    """In Prometheus' text format."""
    return Response(service.telemetry.metrics.exposition(), media_type=CONTENT_TYPE_LATEST)


@router.get("/v1/capacity", operation_id="getCapacity", summary="How much can be taken on?")
def capacity(service: CurrentService, caller: CurrentCaller) -> Capacity:
    """Workers, queue and limits as they are now, and the share of the caller's tenant."""
    settings, limits = service.settings, caller.limits
    running = service.jobs.count("running")
    return Capacity(
        workers=settings.workers,
        threads_per_worker=settings.threads,
        running=running,
        free=max(0, settings.workers - running),
        queued=service.jobs.count("queued"),
        queue_limit=settings.queue_limit,
        max_body_bytes=settings.max_body_bytes,
        max_wait_s=settings.max_wait_s,
        job_timeout_s=settings.job_timeout_s,
        job_memory_bytes=settings.job_memory_bytes,
        share=Share(
            requests_per_s=limits.requests_per_s,
            queued=service.jobs.count("queued", caller.tenant),
            queue_limit=limits.queue_limit,
            stored_bytes=service.storage_quota.stored(caller.tenant),
            stored_bytes_limit=limits.stored_bytes,
        ),
    )
