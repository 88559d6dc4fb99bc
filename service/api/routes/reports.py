"""/v1/registrations/{id}/report and .../preview.png: the result for people."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import AbstractContextManager
from importlib.metadata import version
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import FileResponse
from starlette.concurrency import run_in_threadpool

from service.api.dependencies import CurrentCaller, CurrentRuntime, RequestedJob
from service.api.download import DownloadResponse
from service.api.export import exported_file, require_pair
from service.api.middleware.conditional import NOT_MODIFIED
from service.api.routes.deviation import Tolerances
from service.jobs.fingerprint import hash_json
from service.jobs.model import JobRow
from service.report.page import CONTENT_POLICY
from service.runtime import Runtime
from service.schemas.serialize_job import summarize_job
from service.workers.export_report import ExportPicture, ExportReport
from service.workers.exporter import ExportedFile

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

MAX_UNIT_LENGTH = 16
HTML, PNG = "text/html; charset=utf-8", "image/png"
Unit = Annotated[
    str | None,
    Query(
        max_length=MAX_UNIT_LENGTH,
        pattern=r"^[^\x00-\x1f]*$",
        description="Name of the unit of the files, such as mm, which is written behind lengths; "
        "no number is converted. Default: the label `unit` of the registration.",
    ),
]


async def _picture_tag(job: RequestedJob) -> str:
    return f'"{hash_json([job.work_key, job.result_sha256, "picture"])}"'


async def _report_tag(job: RequestedJob, tolerances: Tolerances = None, unit: Unit = None) -> str:
    """Return the ETag of the report, before it is made."""
    what = [job.id, job.result_sha256, "report", tolerances, unit]
    return f'"{hash_json(what)}"'


PictureTag = Annotated[str, Depends(_picture_tag)]
ReportTag = Annotated[str, Depends(_report_tag)]


async def _export_picture(
    request: Request,
    job: RequestedJob,
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    tag: PictureTag,
) -> AsyncIterator[ExportedFile | None]:
    """Draw the picture; None where the caller has it already."""
    export = await run_in_threadpool(_prepare_picture, job, runtime)
    async with exported_file(request, runtime, caller, tag, export) as file:
        yield file


async def _export_report(
    request: Request,
    job: RequestedJob,
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    tag: ReportTag,
    tolerances: Tolerances = None,
    unit: Unit = None,
) -> AsyncIterator[ExportedFile | None]:
    """Write the report; None where the caller has it already."""
    export = await run_in_threadpool(_prepare_report, job, runtime, tolerances or [], unit)
    async with exported_file(request, runtime, caller, tag, export) as file:
        yield file


def _prepare_picture(job: JobRow, runtime: Runtime) -> AbstractContextManager[ExportedFile]:
    pair, _ = require_pair(job, runtime)
    return runtime.exporter.export(job, lambda environment: ExportPicture(environment, pair))


def _prepare_report(
    job: JobRow, runtime: Runtime, tolerances: list[float], unit: str | None
) -> AbstractContextManager[ExportedFile]:
    pair, result = require_pair(job, runtime)
    named = unit or job.labels.get("unit", "")[:MAX_UNIT_LENGTH]
    summary = summarize_job(job).model_dump(mode="json")
    return runtime.exporter.export(
        job,
        lambda environment: ExportReport(
            environment, pair, summary, result, tolerances, named or None, version("mpe")
        ),
    )


@router.get(
    "/{job_id}/preview.png",
    operation_id="getPicture",
    summary="Fetch a picture of both clouds, before and after",
    response_class=FileResponse,
    responses={
        200: {
            "content": {PNG: {"schema": {"type": "string", "format": "binary"}}},
            "description": "Both clouds from three fixed sides (x to the right; from above for the "
            "last), as the files have them and aligned.",
        }
    },
)
def picture(
    job: RequestedJob,
    file: Annotated[ExportedFile | None, Depends(_export_picture)],
    tag: PictureTag,
) -> Response:
    """Draw on demand, in a process of its own; not for a caller who has the picture already."""
    return _respond(job, file, tag, PNG, {})


@router.get(
    "/{job_id}/report",
    operation_id="getReport",
    summary="Fetch a report to read and print",
    response_class=FileResponse,
    responses={
        200: {
            "content": {"text/html": {"schema": {"type": "string"}}},
            "description": "One HTML page without anything outside of it: verdict, clouds, pose in "
            "all forms, quality, distances with pictures from four sides, uncertainty, options.",
        }
    },
)
def report(
    job: RequestedJob, file: Annotated[ExportedFile | None, Depends(_export_report)], tag: ReportTag
) -> Response:
    """Write on demand, in a process of its own; not for a caller who has the report already."""
    return _respond(job, file, tag, HTML, {"Content-Security-Policy": CONTENT_POLICY})


def _respond(
    job: JobRow, file: ExportedFile | None, tag: str, media_type: str, headers: dict[str, str]
) -> Response:
    if file is None:
        return Response(status_code=NOT_MODIFIED, headers={"ETag": tag})
    return DownloadResponse(
        file.path,
        media_type=media_type,
        filename=f"{job.id}-{file.path.name}",
        content_disposition_type="inline",
        headers=headers | {"ETag": tag},
    )
