"""/v1/registrations/{id}/preview: a cloud thinned to what a browser draws."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import AbstractContextManager
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import FileResponse
from starlette.concurrency import run_in_threadpool

from service.api.dependencies import CurrentCaller, CurrentRuntime, RequestedJob
from service.api.download import DownloadResponse
from service.api.export import FILE, exported_file, require_pair
from service.api.middleware.conditional import NOT_MODIFIED
from service.jobs.fingerprint import hash_json
from service.jobs.model import JobRow
from service.runtime import Runtime
from service.workers.export_preview import ExportPreview
from service.workers.exporter import ExportedFile

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

MAX_PREVIEW_POINTS = 200_000
"""Points of a preview; browsers turn so many of each cloud smoothly without a graphics card."""
Role = Annotated[Literal["source", "target"], Query(description="Which of the two clouds.")]
MaxPoints = Annotated[
    int,
    Query(ge=1, le=MAX_PREVIEW_POINTS, description="Most points; a larger cloud is thinned."),
]
LAYOUT = (
    "The points in the frame of their file, in random order, little-endian: the bytes `MPEV`, "
    "uint32 version (1), uint32 flags (1: colours, 2: distances), uint32 number n of points, "
    "uint64 number of points of the cloud, three float64 origin (48 bytes so far); then n x 3 "
    "float32 positions relative to the origin, n x 4 uint8 colours (red, green, blue, 255) where "
    "the file has them, and, for the source, n float32 distances of the moved points from the "
    "surface of the whole target, in the input's unit: negative behind it where its normals or its "
    "viewpoint tell the sides. Of a mesh these are samples of its surface."
)


async def _tag(job: RequestedJob, role: Role, max_points: MaxPoints = MAX_PREVIEW_POINTS) -> str:
    """Return the ETag of the preview, before it is made."""
    return f'"{hash_json([job.work_key, job.result_sha256, "preview", role, max_points])}"'


Tag = Annotated[str, Depends(_tag)]


async def _export(
    request: Request,
    job: RequestedJob,
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    tag: Tag,
    role: Role,
    max_points: MaxPoints = MAX_PREVIEW_POINTS,
) -> AsyncIterator[ExportedFile | None]:
    """Write the preview; None where the caller has it already."""
    export = await run_in_threadpool(_prepare, job, runtime, role, max_points)
    async with exported_file(request, runtime, caller, tag, export) as file:
        yield file


def _prepare(
    job: JobRow, runtime: Runtime, role: Role, max_points: int
) -> AbstractContextManager[ExportedFile]:
    pair, _ = require_pair(job, runtime)
    return runtime.exporter.export(
        job, lambda environment: ExportPreview(environment, pair, role, max_points)
    )


@router.get(
    "/{job_id}/preview",
    operation_id="getPreview",
    summary="Fetch a thinned cloud, to draw it",
    response_class=FileResponse,
    responses={
        200: {
            "content": {FILE: {"schema": {"type": "string", "format": "binary"}}},
            "description": LAYOUT,
        }
    },
)
def preview(
    job: RequestedJob, file: Annotated[ExportedFile | None, Depends(_export)], tag: Tag
) -> Response:
    """Thin the cloud in a process of its own; not for a caller who has the preview already."""
    headers = {"ETag": tag}
    if file is None:
        return Response(status_code=NOT_MODIFIED, headers=headers)
    name = f"{job.id}-{file.path.name}"
    return DownloadResponse(file.path, media_type=FILE, filename=name, headers=headers)
