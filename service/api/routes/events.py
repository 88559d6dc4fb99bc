"""/v1/registrations/{id}/events: the changes of a registration, as server-sent events."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Header
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from service.api.dependencies import CurrentRuntime, RequestedJob
from service.jobs.model import JobEvent, JobRow, is_terminal
from service.problems import NotReadyError
from service.schemas import Event
from service.schemas.base import MAX_EXACT_INTEGER

MAX_EVENTS = 100
"""Events that are read at once: a registration that runs for long has thousands, and each stream
would hold them all."""
router = APIRouter(prefix="/v1/registrations", tags=["registrations"])


@router.get(
    "/{job_id}/events",
    operation_id="streamEvents",
    summary="Follow a registration",
    response_class=EventSourceResponse,
)
async def stream_events(
    job: RequestedJob,
    runtime: CurrentRuntime,
    last_event_id: Annotated[
        int,
        Header(ge=0, lt=MAX_EXACT_INTEGER, description="Id of the last event received."),
    ] = 0,
) -> AsyncIterator[ServerSentEvent]:
    """Stream one server-sent event per change, from the first or after `Last-Event-ID`.

    The stream ends when the registration has ended. The data of each event is an `Event`.
    """
    last = last_event_id
    # where the store does not answer the stream ends: the client reconnects with Last-Event-ID
    with (
        contextlib.suppress(NotReadyError),
        runtime.notifier.watch(job.id, only_end=False) as changed,
    ):
        while True:
            changed.clear()
            events, is_over = await run_in_threadpool(_look, runtime, job, last)
            for event in events:
                last = event.number
                data = Event.model_validate(event)
                yield ServerSentEvent(id=str(last), event="progress", data=data)
                if is_terminal(event.status):
                    return
            if len(events) == MAX_EVENTS:
                continue  # there may be more
            if is_over:
                return  # the end was sent before, the registration is deleted, or the service stops
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(changed.wait(), runtime.database.poll_interval_s)


def _look(runtime: CurrentRuntime, job: JobRow, last: int) -> tuple[list[JobEvent], bool]:
    """Return the first events after the last one, and whether the last of all is known.

    The end is asked for first: one that comes in between is among the events then.
    """
    is_over = _is_over(runtime, job)
    events = runtime.jobs.events(job.tenant, job.id, after=last, limit=MAX_EVENTS)
    return events, is_over


def _is_over(runtime: CurrentRuntime, job: JobRow) -> bool:
    current = runtime.jobs.get(job.tenant, job.id)
    return current is None or is_terminal(current.status) or runtime.workers.is_stopped
