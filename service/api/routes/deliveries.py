"""/v1/registrations/{id}/deliveries: the calls to its callback_url."""

from __future__ import annotations

from datetime import UTC, datetime

from fastapi import APIRouter

from service.api.dependencies import CurrentService, KnownJob
from service.problems import NoDeliveryError
from service.schemas import Delivery, DeliveryList, Try
from service.webhooks import outbox as deliveries

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])


@router.get(
    "/{job_id}/deliveries", operation_id="listDeliveries", summary="List the calls to callback_url"
)
def list_deliveries(job: KnownJob, service: CurrentService) -> DeliveryList:
    """Each message with its tries."""
    return DeliveryList(items=[_document(found) for found in service.outbox.of_job(job.id)])


@router.post(
    "/{job_id}/deliveries",
    operation_id="replayDelivery",
    summary="Call callback_url once more",
    status_code=202,
)
def replay(job: KnownJob, service: CurrentService) -> DeliveryList:
    """Plans a new message, due now; answers with all of them."""
    if service.outbox.replay(job.id) is None:
        raise NoDeliveryError("The registration has not ended, or was given no callback_url.")
    return list_deliveries(job, service)


def _document(found: deliveries.Delivery) -> Delivery:
    return Delivery(
        id=found.id,
        status=found.status,
        created_at=_time(found.created_at),
        next_at=None if found.next_at is None else _time(found.next_at),
        tries=[Try(**(tried | {"at": _time(tried["at"])})) for tried in found.tries],
    )


def _time(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, UTC)
