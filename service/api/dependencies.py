"""FastAPI dependencies of the routes, as annotated types."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Header, Path, Query, Request, Security
from fastapi.security import HTTPBearer
from starlette.concurrency import run_in_threadpool

from service.api.admission import reserve_body_bytes
from service.api.body import store_body
from service.api.same_origin import check_origin
from service.api.submission import Submission, read_submission
from service.auth.authenticator import Caller
from service.database.pagination import CURSOR, Place, decode_cursor
from service.jobs.model import JobRow
from service.problems import UnknownRegistrationError
from service.runtime import Runtime
from service.schemas import FormatName
from service.storage.blobs import Blob

_WAIT_PREFERENCE = re.compile(
    r"(?:^|[,;])\s*wait\s*=\s*\"?(\d{1,6})\"?\s*(?=[,;]|$)", re.IGNORECASE
)
"""`wait=N` in a Prefer header (RFC 7240), N in whole seconds."""


# dependencies that do not wait are coroutines: FastAPI calls others in one of its few threads


async def _runtime(request: Request) -> Runtime:
    runtime: Runtime = request.app.state.runtime
    return runtime


CurrentRuntime = Annotated[Runtime, Depends(_runtime)]

_bearer = HTTPBearer(
    scheme_name="key",
    bearerFormat="mpe_<id>_<secret>",
    description="A key made by `mpe keys create`; a service without keys needs none.",
    auto_error=False,
)


async def identify(
    request: Request, runtime: CurrentRuntime, _: Annotated[object, Security(_bearer)]
) -> Caller:
    """Authenticate the caller and count the request towards the rate limit.

    Raises
    ------
    UnauthorizedError
        The key is missing or not valid.
    HostRefusedError, OriginRefusedError
        There is no key, and the request may come from a page of another site.
    RateLimitedError
        The key is used too often.
    """
    authorization = request.headers.getlist("authorization")
    caller = runtime.authenticator.from_cache(authorization)
    if caller is None:
        caller = await run_in_threadpool(runtime.authenticator.authenticate, authorization)
    if caller.key_id is None:
        check_origin(request, runtime.settings)
    request.scope["caller"] = caller
    runtime.rate_limiter.check(caller)
    return caller


CurrentCaller = Annotated[Caller, Depends(identify)]


@dataclass(frozen=True, slots=True)
class PageRequest:
    """Which page of a list to return."""

    limit: int
    before: Place | None
    """Where the previous page ends; None: the first page."""


async def _page(
    limit: Annotated[int, Query(ge=1, le=200, description="Most items of the page.")] = 50,
    cursor: Annotated[
        str | None, Query(pattern=CURSOR, description="next_cursor of the previous page.")
    ] = None,
) -> PageRequest:
    return PageRequest(limit, None if cursor is None else decode_cursor(cursor))


RequestedPage = Annotated[PageRequest, Depends(_page)]


async def _preferred_wait_s(
    runtime: CurrentRuntime,
    prefer: Annotated[
        str | None,
        Header(
            description="`wait=N`: respond when the registration has ended, after N seconds at the "
            "latest. The registration goes on either way."
        ),
    ] = None,
) -> float | None:
    wait = _WAIT_PREFERENCE.search(prefer or "")
    return None if wait is None else min(float(wait.group(1)), runtime.settings.max_wait_s)


PreferredWait = Annotated[float | None, Depends(_preferred_wait_s)]


async def _idempotency_key(
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    idempotency_key: Annotated[
        str | None,
        Header(
            min_length=1,
            max_length=255,
            description="Any text of the caller's choice: the same request repeated with it "
            "returns the same registration; a different request with it is refused.",
        ),
    ] = None,
) -> AsyncIterator[str | None]:
    with runtime.in_flight_keys.lock(caller.tenant, idempotency_key):
        yield idempotency_key


IdempotencyKey = Annotated[str | None, Depends(_idempotency_key)]


async def _submission(
    request: Request, runtime: CurrentRuntime, caller: CurrentCaller, _key: IdempotencyKey
) -> Submission:
    async with reserve_body_bytes(request, runtime, caller) as counted:
        return await read_submission(counted, runtime, caller.tenant)


NewSubmission = Annotated[Submission, Depends(_submission)]


async def _raw_body(request: Request, runtime: CurrentRuntime, caller: CurrentCaller) -> Blob:
    async with reserve_body_bytes(request, runtime, caller) as counted:
        return await store_body(counted, runtime.blobs, runtime.settings.max_body_bytes)


RawBody = Annotated[Blob, Depends(_raw_body)]

DeclaredFormat = Annotated[
    FormatName | None,
    Query(
        description="Format of the file, one of GET /v1/formats, where its content does not tell: "
        "`kitti` has no header."
    ),
]


def require_job(job: JobRow | None) -> JobRow:
    """Return the job.

    Raises
    ------
    UnknownRegistrationError
        It is None.
    """
    if job is None:
        raise UnknownRegistrationError("No registration has this id; it may have been deleted.")
    return job


def _requested_job(
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    job_id: Annotated[str, Path(description="Id of the registration.")],
) -> JobRow:
    return require_job(runtime.jobs.get(caller.tenant, job_id))


RequestedJob = Annotated[JobRow, Depends(_requested_job)]
