"""/livez and /readyz."""

from __future__ import annotations

from fastapi import APIRouter

from service.dependencies import CurrentService
from service.problems import NotReadyError
from service.schemas import Health

router = APIRouter(tags=["health"])


@router.get("/livez", operation_id="getLiveness", summary="Is the process alive?")
def livez() -> Health:
    """200 as long as the process answers at all."""
    return Health()


@router.get("/readyz", operation_id="getReadiness", summary="Do registrations start at once?")
def readyz(service: CurrentService) -> Health:
    """200 when the workers are warm; 503 before that and while the service stops."""
    if not service.queue.is_ready:
        raise NotReadyError("The workers are not ready.", headers={"Retry-After": "1"})
    return Health()
