"""/v1/registrations: submit, look at, list, cancel and remove."""

from __future__ import annotations

import re
import time
from datetime import UTC, datetime
from typing import Annotated, Any
from uuid import uuid4

from fastapi import APIRouter, Query, Response
from pydantic import BeforeValidator
from starlette.concurrency import run_in_threadpool

from service.api.dependencies import (
    CurrentCaller,
    CurrentService,
    IdempotencyKey,
    KnownJob,
    NewSubmission,
    PreferredWait,
    known,
)
from service.api.error_handlers import ProblemResponse
from service.api.long_poll import wait_until_ended
from service.api.submission import Submission
from service.database.pagination import CURSOR, decode_cursor, encode_cursor
from service.jobs.fingerprint import hash_work
from service.jobs.idempotency import Idempotency
from service.jobs.model import JobRow, JobStatus, is_terminal
from service.jobs.queries import JobFilter
from service.runtime import Runtime
from service.schemas import Job, JobPage, RegistrationRequest
from service.schemas.serialize_job import document, summary

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

RETRY_AFTER_S = 1


def _no_number(moment: str) -> str:
    """Pydantic would take a number for seconds since the epoch."""
    if not re.match(r"\d{4}-\d\d-\d\d[Tt ]", moment):
        raise ValueError("expected a date and time as in 2026-01-05T09:30:00Z")
    return moment


Moment = Annotated[datetime, BeforeValidator(_no_number)]
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
    submission: NewSubmission,
    key: IdempotencyKey,
    wait_s: PreferredWait,
    service: CurrentService,
    caller: CurrentCaller,
) -> Response:
    """Answers 202 with the job, or with `Prefer: wait=N` 200 when it ends within N seconds.

    When it ends in time because of its input (a file that cannot be read, too few points, ...),
    the answer is the problem document, status 422 (403 for an address that may not be called),
    and `job` in it names the failed job.
    """
    idempotency = None if key is None else Idempotency(key, submission.fingerprint())
    job = await run_in_threadpool(
        service.submit,
        _new_job(submission, caller.tenant),
        idempotency,
        tenant_queue_limit=caller.limits.queue_limit,
    )
    if wait_s is not None:
        job = await wait_until_ended(service, caller.tenant, job.id, wait_s) or job
    return await _accepted(job, wait_s, service)


@router.get(
    "",
    operation_id="listRegistrations",
    summary="List registrations, newest first",
    response_model=JobPage,
)
def list_page(
    service: CurrentService,
    caller: CurrentCaller,
    limit: Annotated[int, Query(ge=1, le=200, description="Most items of the page.")] = 50,
    cursor: Annotated[
        str | None, Query(pattern=CURSOR, description="next_cursor of the page before.")
    ] = None,
    status: Annotated[JobStatus | None, Query(description="Only those of this status.")] = None,
    label: Annotated[
        str | None,
        Query(pattern=r"^[A-Za-z0-9_.-]{1,64}:", description="Only those labelled name:value."),
    ] = None,
    created_after: Annotated[Moment | None, Query(description="Only later ones.")] = None,
    created_before: Annotated[Moment | None, Query(description="Only earlier ones.")] = None,
) -> JobPage:
    """Jobs without their results; follow `next_cursor` until it is null."""
    only = JobFilter(
        status=status,
        label=None if label is None else _split(label),
        created_after=_seconds(created_after),
        created_before=_seconds(created_before),
    )
    before = None if cursor is None else decode_cursor(cursor)
    jobs = service.jobs.page(caller.tenant, limit=limit + 1, before=before, only=only)
    more = encode_cursor(jobs[limit - 1]) if len(jobs) > limit else None
    return JobPage(items=[summary(job) for job in jobs[:limit]], next_cursor=more)


@router.get(
    "/{job_id}",
    operation_id="getRegistration",
    summary="Look at a registration",
    response_model=Job,
)
async def get(
    job_id: str, wait_s: PreferredWait, service: CurrentService, caller: CurrentCaller
) -> Response:
    """The job as it is now, or with `Prefer: wait=N` as soon as it has ended."""
    job = known(await wait_until_ended(service, caller.tenant, job_id, wait_s or 0.0))
    headers = _applied(wait_s)
    if not is_terminal(job.status):
        headers["Retry-After"] = str(RETRY_AFTER_S)
    return Response(await _rendered(job, service), media_type="application/json", headers=headers)


@router.delete(
    "/{job_id}",
    operation_id="deleteRegistration",
    summary="Cancel a registration, or remove one that has ended",
    status_code=200,
    response_model=Job,
    responses={204: {"description": "It had ended, and is removed.", "model": None}},
)
def delete(job: KnownJob, service: CurrentService) -> Response:
    """Cancels what waits or runs (200 with the job); removes what has ended (204)."""
    if service.cancel(job.id):
        body = document(known(service.jobs.get(job.tenant, job.id)), service.blobs)
        return Response(body, media_type="application/json")
    if not service.transitions.remove(job.id):
        known(None)
    return Response(status_code=204)


def _new_job(submission: Submission, tenant: str) -> JobRow:
    wanted, now = submission.parameters, time.time()
    options = wanted.options.model_dump()
    return JobRow(
        id=str(uuid4()),
        tenant=tenant,
        source=submission.source,
        target=submission.target,
        options=options,
        created_at=now,
        labels=wanted.labels,
        priority=wanted.priority,
        deadline_at=None if wanted.deadline_s is None else now + wanted.deadline_s,
        callback_url=wanted.callback_url,
        work_key=hash_work(submission.source, submission.target, options),
    )


async def _accepted(job: JobRow, wait_s: float | None, service: Runtime) -> Response:
    headers = {"Location": f"{router.prefix}/{job.id}", **_applied(wait_s)}
    if job.error is not None and job.error["status"] < 500:
        problem = {**job.error, "job": job.id}
        return ProblemResponse(problem, status_code=problem["status"], headers=headers)
    ended = is_terminal(job.status)
    if not ended:
        headers["Retry-After"] = str(RETRY_AFTER_S)
    return Response(
        await _rendered(job, service),
        status_code=200 if ended else 202,
        media_type="application/json",
        headers=headers,
    )


async def _rendered(job: JobRow, service: Runtime) -> bytes:
    """The job's document; only a result has to be read from the disk."""
    if job.result_sha256 is None:
        return document(job, service.blobs)
    return await run_in_threadpool(document, job, service.blobs)


def _applied(wait_s: float | None) -> dict[str, str]:
    return {} if wait_s is None else {"Preference-Applied": f"wait={wait_s:.0f}"}


def _split(label: str) -> tuple[str, str]:
    name, _, value = label.partition(":")
    return name, value


def _seconds(moment: datetime | None) -> float | None:
    """Seconds since the epoch; a time without a zone is UTC."""
    if moment is None:
        return None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
