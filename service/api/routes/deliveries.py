"""/v1/registrations/{id}/deliveries: webhook messages to its callback_url."""

from __future__ import annotations

from fastapi import APIRouter

from service.api.dependencies import CurrentRuntime, RequestedJob
from service.problems import NoDeliveryError
from service.schemas import DeliveryList

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])


@router.get(
    "/{job_id}/deliveries",
    operation_id="listDeliveries",
    summary="List the webhook messages of a registration",
)
def list_deliveries(job: RequestedJob, runtime: CurrentRuntime) -> DeliveryList:
    """Return each message with its tries."""
    return DeliveryList.model_validate({"items": runtime.outbox.of_job(job.id)})


@router.post(
    "/{job_id}/deliveries",
    operation_id="replayDelivery",
    summary="Send the webhook message again",
    status_code=202,
)
def replay(job: RequestedJob, runtime: CurrentRuntime) -> DeliveryList:
    """Send a new message, or the one that waits for its next attempt now; return all messages."""
    if not runtime.outbox.replay(job.id):
        raise NoDeliveryError("The registration has not ended, or it has no callback_url.")
    return list_deliveries(job, runtime)
