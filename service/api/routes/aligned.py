"""/v1/registrations/{id}/aligned: the source in the target's frame, as a file."""

from __future__ import annotations

import json
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
from service.workers.export_aligned import ExportAligned
from service.workers.exporter import ExportedFile

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

_MAX_WARNING_LENGTH = 400
_MAX_HEADER_LENGTH = 4000
"""Characters of a header; proxies allow about 8,000 for all."""
Format = Annotated[
    Literal["ply", "pcd", "las", "laz", "e57", "npy", "xyz", "csv", "obj", "stl", "glb"],
    Query(description="Format of the file; STL needs a source with faces."),
]
Merged = Annotated[
    bool,
    Query(description="Append the target; the attribute `cloud` is 0 for the source, 1 for it."),
]


Distances = Annotated[
    bool,
    Query(
        description="Add the distance of each point from the target's surface, in the input's "
        "unit: the scalar field `distance` of CloudCompare, extra bytes of LAS, a field of PCD, a "
        "column of text. Points outside of the target are positive and those inside negative, "
        "where its file has normals or the option target_viewpoint is given; else all are positive."
    ),
]


async def _tag(
    job: RequestedJob,
    format: Format = "ply",
    merged: Merged = False,
    distances: Distances = False,
) -> str:
    """Return the ETag of the file, before it is written: weak, as LAS files hold the day."""
    what = [job.work_key, job.result_sha256, format, merged, distances]
    return f'W/"{hash_json(what)}"'


Tag = Annotated[str, Depends(_tag)]


async def _export(
    request: Request,
    job: RequestedJob,
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    tag: Tag,
    format: Format = "ply",
    merged: Merged = False,
    distances: Distances = False,
) -> AsyncIterator[ExportedFile | None]:
    """Write the file; None where the caller has it already."""
    export = await run_in_threadpool(_prepare, job, runtime, format, merged, distances)
    async with exported_file(request, runtime, caller, tag, export) as file:
        yield file


def _prepare(
    job: JobRow, runtime: Runtime, format: str, merged: bool, distances: bool
) -> AbstractContextManager[ExportedFile]:
    pair, _ = require_pair(job, runtime)
    return runtime.exporter.export(
        job,
        lambda environment: ExportAligned(
            environment, pair, is_merged=merged, has_distances=distances, format=format
        ),
    )


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
    job: RequestedJob, file: Annotated[ExportedFile | None, Depends(_export)], tag: Tag
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
