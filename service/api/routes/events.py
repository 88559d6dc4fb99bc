"""/v1/registrations/{id}/events: what happens to a registration, as it happens."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Header
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from service.api.dependencies import CurrentService, KnownJob
from service.jobs.model import JobEvent, JobRow, is_terminal
from service.schemas import Event
from service.schemas.options import EXACT

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])


@router.get(
    "/{job_id}/events",
    operation_id="streamEvents",
    summary="Follow a registration",
    response_class=EventSourceResponse,
)
async def events(
    job: KnownJob,
    service: CurrentService,
    last_event_id: Annotated[
        int,
        Header(ge=0, lt=EXACT, description="Number of the last event that was received."),
    ] = 0,
) -> AsyncIterator[ServerSentEvent]:
    """Server-sent events, one for each change, from the first or from after `Last-Event-ID`.

    The stream ends with the registration. The data of an event is an `Event`.
    """
    last = last_event_id
    with service.notifier.watch(job.id, only_end=False) as changed:
        while True:
            changed.clear()
            news = await run_in_threadpool(service.jobs.events, job.tenant, job.id, after=last)
            for event in news:
                last = event.number
                yield ServerSentEvent(id=str(last), event="progress", data=_data(event))
                if is_terminal(event.status):
                    return
            if not news and await run_in_threadpool(_is_over, service, job):
                return  # removed, or the service stops: the client comes back with Last-Event-ID
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(changed.wait(), service.database.poll_interval_s)


def _is_over(service: CurrentService, job: JobRow) -> bool:
    now = service.jobs.get(job.tenant, job.id)
    return now is None or is_terminal(now.status) or service.workers.is_stopped


def _data(event: JobEvent) -> Event:
    return Event(
        at=datetime.fromtimestamp(event.at, UTC),
        status=event.status,
        stage=event.stage,
        fraction=event.fraction,
    )
