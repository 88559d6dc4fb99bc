"""/v1/registrations/{id}/aligned: the source in the target's frame, as a file."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from contextlib import AbstractContextManager, ExitStack
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import FileResponse
from starlette.concurrency import run_in_threadpool

from service.api.admission import check_disk, count_file
from service.api.dependencies import CurrentCaller, CurrentRuntime, RequestedJob
from service.api.disconnect import unless_disconnected
from service.api.download import DownloadResponse
from service.api.middleware.conditional import NOT_MODIFIED, is_known
from service.api.threads import OwnThreads
from service.jobs.fingerprint import hash_json
from service.jobs.model import JobRow
from service.problems import ExpiredError, ResultNotReadyError
from service.runtime import Runtime
from service.workers.exporter import MAX_RUNNING, AlignedFile

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

FILE = "application/octet-stream"
_MAX_WARNING_LENGTH = 400
_MAX_HEADER_LENGTH = 4000
"""Characters of a header; proxies allow about 8,000 for all."""
_EXPORTS = OwnThreads(MAX_RUNNING)
Format = Annotated[
    Literal["ply", "pcd", "las", "laz", "e57", "npy", "xyz", "csv", "obj", "stl", "glb"],
    Query(description="Format of the file; STL needs a source with faces."),
]
Merged = Annotated[
    bool,
    Query(description="Append the target; the attribute `cloud` is 0 for the source, 1 for it."),
]


def _tag(job: RequestedJob, format: Format = "ply", merged: Merged = False) -> str:
    """Return the ETag of the file, before it is written: weak, as LAS files hold the day."""
    return f'W/"{hash_json([job.work_key, job.result_sha256, format, merged])}"'


Tag = Annotated[str, Depends(_tag)]


async def _export(
    request: Request,
    job: RequestedJob,
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    tag: Tag,
    format: Format = "ply",
    merged: Merged = False,
) -> AsyncIterator[AlignedFile | None]:
    """Write the file, count it as stored, and remove it once the response has been sent.

    None where the caller has the file already.
    """
    export = await run_in_threadpool(_prepare, job, runtime, format, merged)
    if is_known(tag, request.headers.get("If-None-Match", "")):
        yield None
        return
    with ExitStack() as file:
        await unless_disconnected(request, runtime.export_gate.acquire(job.tenant))
        try:
            written = await _EXPORTS.run(lambda: file.enter_context(export))
        finally:
            runtime.export_gate.release(job.tenant)
        try:
            await run_in_threadpool(file.enter_context, count_file(runtime, caller, written.path))
            yield written
        finally:
            await run_in_threadpool(file.close)


def _prepare(
    job: JobRow, runtime: Runtime, format: str, merged: bool
) -> AbstractContextManager[AlignedFile]:
    if job.status != "succeeded":
        raise ResultNotReadyError(
            f"The registration is {job.status}; only a result can be applied."
        )
    blobs = (job.result_sha256, job.source.sha256, job.target.sha256)
    result, *clouds = (None if blob is None else runtime.blobs.path(blob) for blob in blobs)
    if result is None or not all(path and path.exists() for path in (result, *clouds)):
        raise ExpiredError("The result or a cloud has expired; register the clouds again.")
    transform = json.loads(result.read_bytes())["transform"]
    check_disk(runtime)
    return runtime.exporter.export(job, transform, format=format, merged=merged)


@router.get(
    "/{job_id}/aligned",
    operation_id="getAligned",
    summary="Fetch the source in the target's frame",
    response_class=FileResponse,
    responses={
        200: {
            "content": {FILE: {"schema": {"type": "string", "format": "binary"}}},
            "description": "The moved source, in the order of its file. Attributes and faces are "
            "kept as far as the format can hold them; normals, velocities and Gaussian splats are "
            "turned.",
            "headers": {
                "X-Warnings": {
                    "description": "What the format cannot hold, as a JSON array of texts.",
                    "schema": {"type": "string"},
                }
            },
        }
    },
)
def aligned(
    job: RequestedJob, file: Annotated[AlignedFile | None, Depends(_export)], tag: Tag
) -> Response:
    """Write the file on demand, in a process of its own; not for a caller who has it already."""
    headers = {"ETag": tag}
    if file is None:
        return Response(status_code=NOT_MODIFIED, headers=headers)
    if file.warnings:
        headers["X-Warnings"] = _render_warnings(file.warnings)
    name = f"{job.id}-{file.path.name}"
    return DownloadResponse(file.path, media_type=FILE, filename=name, headers=headers)


def _render_warnings(warnings: tuple[str, ...]) -> str:
    """Return a JSON array in ASCII, short enough for a header of HTTP."""
    kept = [warning[:_MAX_WARNING_LENGTH] for warning in warnings]
    while len(text := json.dumps(kept)) > _MAX_HEADER_LENGTH:
        kept = kept[:-1]
    return text
