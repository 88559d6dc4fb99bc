"""/v1/registrations: submit, look at, list, cancel and remove."""

from __future__ import annotations

import time
from typing import Annotated, Any
from uuid import uuid4

from fastapi import APIRouter, Query, Response
from starlette.concurrency import run_in_threadpool

from service.core import Service
from service.dependencies import CurrentService, NewSubmission, PreferredWait
from service.documents import decode_cursor, document, encode_cursor, summary
from service.errors import ProblemResponse
from service.jobs.job import JobRow, is_terminal
from service.problems import UnknownRegistrationError
from service.schemas import Job, JobPage, RegistrationRequest
from service.submission import Submission
from service.waiting import settled

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

RETRY_AFTER_S = 1
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
    submission: NewSubmission, wait_s: PreferredWait, service: CurrentService
) -> Response:
    """Answers 202 with the job, or with `Prefer: wait=N` 200 when it ends within N seconds.

    When it ends in time because of its input (a file that cannot be read, too few points, ...),
    the answer is the problem document, status 422, and `job` in it names the failed job.
    """
    job = _new_job(submission)
    await run_in_threadpool(service.store.add, job)
    service.queue.notify()
    if wait_s is not None:
        job = await settled(service, job.id, wait_s) or job
    return await run_in_threadpool(_accepted, job, wait_s, service)


@router.get(
    "",
    operation_id="listRegistrations",
    summary="List registrations, newest first",
    response_model=JobPage,
)
def list_page(
    service: CurrentService,
    limit: Annotated[int, Query(ge=1, le=200, description="Most items of the page.")] = 50,
    cursor: Annotated[
        str | None, Query(max_length=200, description="next_cursor of the page before.")
    ] = None,
) -> JobPage:
    """Jobs without their results; follow `next_cursor` until it is null."""
    before = None if cursor is None else decode_cursor(cursor)
    jobs = service.store.page(limit=limit + 1, before=before)
    more = encode_cursor(jobs[limit - 1]) if len(jobs) > limit else None
    return JobPage(items=[summary(job) for job in jobs[:limit]], next_cursor=more)


@router.get(
    "/{job_id}",
    operation_id="getRegistration",
    summary="Look at a registration",
    response_model=Job,
)
async def get(job_id: str, wait_s: PreferredWait, service: CurrentService) -> Response:
    """The job as it is now, or with `Prefer: wait=N` as soon as it has ended."""
    job = known(await settled(service, job_id, wait_s or 0.0))
    headers = _applied(wait_s)
    if not is_terminal(job.status):
        headers["Retry-After"] = str(RETRY_AFTER_S)
    body = await run_in_threadpool(document, job, service.blobs)
    return Response(body, media_type="application/json", headers=headers)


@router.delete(
    "/{job_id}",
    operation_id="deleteRegistration",
    summary="Cancel a registration, or remove one that has ended",
    status_code=200,
    response_model=Job,
    responses={204: {"description": "It had ended, and is removed.", "model": None}},
)
def delete(job_id: str, service: CurrentService) -> Response:
    """Cancels what waits or runs (200 with the job); removes what has ended (204)."""
    if service.store.cancel(job_id):
        service.queue.kill(job_id)
        service.changes.announce(job_id)
        body = document(known(service.store.get(job_id)), service.blobs)
        return Response(body, media_type="application/json")
    if not service.store.remove(job_id):
        raise unknown()
    return Response(status_code=204)


def known(job: JobRow | None) -> JobRow:
    """The job, or UnknownRegistrationError."""
    if job is None:
        raise unknown()
    return job


def unknown() -> UnknownRegistrationError:
    """What is said of an id that names no registration."""
    return UnknownRegistrationError("No registration has this id; it may have been removed.")


def _new_job(submission: Submission) -> JobRow:
    return JobRow(
        id=str(uuid4()),
        source=submission.source,
        target=submission.target,
        options=submission.parameters.options.model_dump(),
        created_at=time.time(),
    )


def _accepted(job: JobRow, wait_s: float | None, service: Service) -> Response:
    headers = {"Location": f"{router.prefix}/{job.id}", **_applied(wait_s)}
    if job.error is not None and job.error["status"] == 422:
        return ProblemResponse({**job.error, "job": job.id}, status_code=422, headers=headers)
    ended = is_terminal(job.status)
    if not ended:
        headers["Retry-After"] = str(RETRY_AFTER_S)
    return Response(
        document(job, service.blobs),
        status_code=200 if ended else 202,
        media_type="application/json",
        headers=headers,
    )


def _applied(wait_s: float | None) -> dict[str, str]:
    return {} if wait_s is None else {"Preference-Applied": f"wait={wait_s:.0f}"}
