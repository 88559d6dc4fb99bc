"""What the routes ask for, as annotated dependencies."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import Depends, Header, Path, Request
from starlette.concurrency import run_in_threadpool

from service.admission import admit
from service.body import read_file
from service.core import Service
from service.jobs.job import JobRow
from service.problems import UnknownRegistrationError
from service.storage import Blob
from service.submission import Submission, read_submission

_WAIT = re.compile(r"(?:^|[,;])\s*wait\s*=\s*\"?(\d{1,6})\"?\s*(?=[,;]|$)", re.IGNORECASE)


def _service(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


CurrentService = Annotated[Service, Depends(_service)]


def _wait(
    service: CurrentService,
    prefer: Annotated[
        str | None,
        Header(
            description="`wait=N`: answer when the registration has ended, after N seconds at the "
            "latest. The registration goes on either way."
        ),
    ] = None,
) -> float | None:
    asked = _WAIT.search(prefer or "")
    return None if asked is None else min(float(asked.group(1)), service.settings.max_wait_s)


PreferredWait = Annotated[float | None, Depends(_wait)]


async def _idempotency_key(
    service: CurrentService,
    idempotency_key: Annotated[
        str | None,
        Header(
            min_length=1,
            max_length=255,
            description="A word of the caller's own: the same request again under it is answered "
            "with the same registration, another request is refused.",
        ),
    ] = None,
) -> AsyncIterator[str | None]:
    with service.keys_in_flight.hold(idempotency_key):
        yield idempotency_key


IdempotencyKey = Annotated[str | None, Depends(_idempotency_key)]


async def _submission(
    request: Request, service: CurrentService, _key: IdempotencyKey
) -> Submission:
    await run_in_threadpool(admit, service)
    return await read_submission(request, service)


NewSubmission = Annotated[Submission, Depends(_submission)]


async def _raw_body(request: Request, service: CurrentService) -> Blob:
    await run_in_threadpool(admit, service)
    return await read_file(request, service.blobs, service.settings.max_body_bytes)


RawBody = Annotated[Blob, Depends(_raw_body)]


def known(job: JobRow | None) -> JobRow:
    """The job; UnknownRegistrationError when it is None."""
    if job is None:
        raise UnknownRegistrationError("No registration has this id; it may have been removed.")
    return job


def _known_job(
    service: CurrentService, job_id: Annotated[str, Path(description="Id of the registration.")]
) -> JobRow:
    return known(service.store.get(job_id))


KnownJob = Annotated[JobRow, Depends(_known_job)]
