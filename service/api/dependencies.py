"""What the routes ask for, as annotated dependencies."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import Depends, Header, Path, Query, Request, Security
from fastapi.security import HTTPBearer
from starlette.concurrency import run_in_threadpool

from service.api.admission import reserve_body_bytes
from service.api.body import read_file
from service.api.same_origin import check_origin
from service.api.submission import Submission, read_submission
from service.auth.authenticator import Caller
from service.jobs.model import JobRow
from service.problems import UnknownRegistrationError
from service.runtime import Runtime
from service.schemas import FormatName
from service.storage.blobs import Blob

_WAIT = re.compile(r"(?:^|[,;])\s*wait\s*=\s*\"?(\d{1,6})\"?\s*(?=[,;]|$)", re.IGNORECASE)


def _service(request: Request) -> Runtime:
    service: Runtime = request.app.state.service
    return service


CurrentService = Annotated[Runtime, Depends(_service)]
_bearer = HTTPBearer(
    scheme_name="key",
    bearerFormat="mpe_<id>_<secret>",
    description="A key made by `mpe keys create`; a service without keys needs none.",
    auto_error=False,
)


async def identify(
    request: Request, service: CurrentService, _: Annotated[object, Security(_bearer)]
) -> Caller:
    """Whoever calls, by the key that is sent, and not more often than it may be used.

    Without a key: whoever is not a page of another site.
    """
    given = request.headers.getlist("authorization")
    caller = service.authenticator.remembered(given)
    if caller is None:
        caller = await run_in_threadpool(service.authenticator.identified, given)
    if caller.key_id is None:
        check_origin(request, service.settings)
    request.scope["caller"] = caller
    service.rate_limiter.count(caller)
    return caller


CurrentCaller = Annotated[Caller, Depends(identify)]


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
    caller: CurrentCaller,
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
    with service.in_flight_keys.lock(caller.tenant, idempotency_key):
        yield idempotency_key


IdempotencyKey = Annotated[str | None, Depends(_idempotency_key)]


async def _submission(
    request: Request, service: CurrentService, caller: CurrentCaller, _key: IdempotencyKey
) -> Submission:
    async with reserve_body_bytes(request, service, caller):
        return await read_submission(request, service, caller.tenant)


NewSubmission = Annotated[Submission, Depends(_submission)]


async def _raw_body(request: Request, service: CurrentService, caller: CurrentCaller) -> Blob:
    async with reserve_body_bytes(request, service, caller):
        return await read_file(request, service.blobs, service.settings.max_body_bytes)


DeclaredFormat = Annotated[
    FormatName | None,
    Query(
        description="Format of the file, one of GET /v1/formats, where its content does not tell: "
        "`kitti` has no header."
    ),
]
RawBody = Annotated[Blob, Depends(_raw_body)]


def known(job: JobRow | None) -> JobRow:
    """The job; UnknownRegistrationError when it is None."""
    if job is None:
        raise UnknownRegistrationError("No registration has this id; it may have been removed.")
    return job


def _known_job(
    service: CurrentService,
    caller: CurrentCaller,
    job_id: Annotated[str, Path(description="Id of the registration.")],
) -> JobRow:
    return known(service.jobs.get(caller.tenant, job_id))


KnownJob = Annotated[JobRow, Depends(_known_job)]
