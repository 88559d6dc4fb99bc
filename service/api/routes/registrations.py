"""/v1/registrations: submit, look at, list, cancel and delete registrations."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from pydantic import AfterValidator, BeforeValidator
from starlette.concurrency import run_in_threadpool

from service.api.dependencies import (
    CurrentCaller,
    CurrentRuntime,
    IdempotencyKey,
    NewSubmission,
    PageRequest,
    PreferredWait,
    RequestedJob,
    RequestedPage,
    require_job,
)
from service.api.disconnect import unless_disconnected
from service.api.error_handlers import ProblemResponse
from service.api.long_poll import wait_until_ended
from service.api.submission import Submission
from service.api.threads import OwnThreads
from service.auth.authenticator import Caller
from service.database.pagination import cut_page
from service.jobs.idempotency import Idempotency
from service.jobs.model import JobRow, JobStatus, is_terminal
from service.jobs.queries import JobFilter
from service.jobs.search import MAX_WORDS, split_words
from service.runtime import Runtime
from service.schemas import Job, JobPage, RegistrationRequest
from service.schemas.serialize_job import render_job, summarize_job

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

_SEARCHING = OwnThreads(2)
"""Threads that look at each registration of a tenant, which takes long where it has many."""
POLL_AGAIN_S = 1
"""Retry-After of a registration that has not ended, in seconds."""


def _require_iso_date(text: str) -> str:
    """Refuse what pydantic would take for seconds since the epoch."""
    if not re.match(r"\d{4}-\d\d-\d\d[Tt ]", text):
        raise ValueError("expected a date and time as in 2026-01-05T09:30:00Z")
    return text


def _require_few_words(text: str) -> str:
    split_words(text)
    return text


Timestamp = Annotated[datetime, BeforeValidator(_require_iso_date)]
Words = Annotated[str, AfterValidator(_require_few_words)]
SEARCH = (
    "Only those that every word is found in, whatever its case: in the value of a label, the id of "
    "a stored cloud or a URL, or at the beginning of the id or of the SHA-256 of a cloud. At most "
    f"{MAX_WORDS} words."
)
_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "multipart/form-data": {"schema": {"$ref": "#/components/schemas/RegistrationForm"}},
            "application/json": {
                "schema": {"$ref": f"#/components/schemas/{RegistrationRequest.__name__}"}
            },
        },
    }
}


@router.post(
    "",
    operation_id="createRegistration",
    summary="Align a source cloud onto a target cloud",
    status_code=202,
    response_model=Job,
    responses={200: {"model": Job, "description": "It ended within the wait."}},
    openapi_extra=_BODY,
)
async def create(
    request: Request,
    submission: NewSubmission,
    key: IdempotencyKey,
    wait_s: PreferredWait,
    runtime: CurrentRuntime,
    caller: CurrentCaller,
) -> Response:
    """Return 202 with the job, or with `Prefer: wait=N` 200 if it ends within N seconds.

    If it fails within the wait because of its input (an unreadable file, too few points, ...), the
    response is the problem document with status 422 (403 for a forbidden URL), and its member
    `job` is the id of the failed job.
    """
    job = await run_in_threadpool(
        _submit,
        runtime,
        submission,
        caller,
        None if key is None else Idempotency(key, submission.fingerprint()),
    )
    if key is not None:
        runtime.in_flight_keys.release(caller.tenant, key)
    if wait_s is not None:
        wait = wait_until_ended(runtime, caller.tenant, job.id, wait_s)
        ended = await unless_disconnected(request, wait)
        job = ended or job
    return await _accepted_response(job, wait_s, runtime)


@router.get(
    "",
    operation_id="listRegistrations",
    summary="List registrations, newest first",
    response_model=JobPage,
)
async def list_registrations(
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    page: RequestedPage,
    status: Annotated[JobStatus | None, Query(description="Only those with this status.")] = None,
    label: Annotated[
        str | None,
        Query(pattern=r"^[A-Za-z0-9_.-]{1,64}:", description="Only those labelled name:value."),
    ] = None,
    search: Annotated[Words, Query(max_length=200, description=SEARCH)] = "",
    created_after: Annotated[Timestamp | None, Query(description="Only later ones.")] = None,
    created_before: Annotated[Timestamp | None, Query(description="Only earlier ones.")] = None,
) -> Response:
    """Return one page of jobs without their results; follow `next_cursor` until it is null."""
    only = JobFilter(
        status=status,
        label=None if label is None else _split_label(label),
        words=split_words(search),
        created_after=_to_epoch(created_after),
        created_before=_to_epoch(created_before),
    )
    render = partial(_render_page, runtime, caller.tenant, page, only)
    looks_at_all = bool(only.words or only.label)
    body = await (_SEARCHING.run(render) if looks_at_all else run_in_threadpool(render))
    return Response(body, media_type="application/json")


@router.get(
    "/{job_id}",
    operation_id="getRegistration",
    summary="Look at a registration",
    response_model=Job,
)
async def get(
    request: Request,
    job_id: str,
    wait_s: PreferredWait,
    runtime: CurrentRuntime,
    caller: CurrentCaller,
) -> Response:
    """Return the job as it is now, or with `Prefer: wait=N` as soon as it has ended."""
    wait = wait_until_ended(runtime, caller.tenant, job_id, wait_s or 0.0)
    job = require_job(await (unless_disconnected(request, wait) if wait_s else wait))
    return await _job_response(job, wait_s, runtime)


@router.delete(
    "/{job_id}",
    operation_id="deleteRegistration",
    summary="Cancel a registration, or delete one that has ended",
    status_code=200,
    response_model=Job,
    responses={204: {"description": "It had ended, and is deleted.", "model": None}},
)
def delete(job: RequestedJob, runtime: CurrentRuntime) -> Response:
    """Cancel a job that waits or runs (200 with the job); delete one that has ended (204)."""
    if runtime.cancel(job.id):
        cancelled = require_job(runtime.jobs.get(job.tenant, job.id))
        return Response(render_job(cancelled, runtime.blobs), media_type="application/json")
    if not runtime.transitions.remove(job.id):
        require_job(None)
    return Response(status_code=204)


def _render_page(runtime: Runtime, tenant: str, page: PageRequest, only: JobFilter) -> str:
    rows = runtime.jobs.page(tenant, limit=page.limit + 1, before=page.before, only=only)
    jobs, next_cursor = cut_page(rows, page.limit)
    items = [summarize_job(job) for job in jobs]
    return JobPage(items=items, next_cursor=next_cursor).model_dump_json()


async def _accepted_response(job: JobRow, wait_s: float | None, runtime: Runtime) -> Response:
    location = {"Location": f"{router.prefix}/{job.id}"}
    if job.error is not None and job.error["status"] < 500:
        problem = {**job.error, "job": job.id}
        headers = location | _preference_applied(wait_s)
        return ProblemResponse(problem, status_code=problem["status"], headers=headers)
    response = await _job_response(job, wait_s, runtime)
    response.headers.update(location)
    response.status_code = 200 if is_terminal(job.status) else 202
    return response


async def _job_response(job: JobRow, wait_s: float | None, runtime: Runtime) -> Response:
    headers = _preference_applied(wait_s)
    if not is_terminal(job.status):
        headers["Retry-After"] = str(POLL_AGAIN_S)
    if job.result_sha256 is None:
        body = render_job(job, runtime.blobs)
    else:
        body = await run_in_threadpool(render_job, job, runtime.blobs)  # it reads the result's file
    return Response(body, media_type="application/json", headers=headers)


def _preference_applied(wait_s: float | None) -> dict[str, str]:
    return {} if wait_s is None else {"Preference-Applied": f"wait={wait_s:.0f}"}


def _split_label(label: str) -> tuple[str, str]:
    name, _, value = label.partition(":")
    return name, value


def _to_epoch(moment: datetime | None) -> float | None:
    """Return seconds since the epoch; a time without a zone is UTC."""
    if moment is None:
        return None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _submit(
    runtime: Runtime, submission: Submission, caller: Caller, idempotency: Idempotency | None
) -> JobRow:
    job = submission.to_job(caller.tenant, runtime.jobs.present())
    return runtime.submit(job, idempotency, tenant_queue_limit=caller.limits.queue_limit)
