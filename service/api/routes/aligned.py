"""/v1/registrations/{id}/aligned: the source in the target's frame, as a file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query
from fastapi.responses import FileResponse

from service.api.dependencies import CurrentRuntime, RequestedJob
from service.problems import ExpiredError, ResultNotReadyError

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

FILE = "application/octet-stream"


def _export(
    job: RequestedJob,
    runtime: CurrentRuntime,
    format: Annotated[
        Literal["ply", "pcd", "laz", "npy"], Query(description="Format of the file.")
    ] = "ply",
    merged: Annotated[
        bool,
        Query(
            description="Append the target; the attribute `cloud` is 0 for the source, 1 for it."
        ),
    ] = False,
) -> Iterator[Path]:
    """Write the file and remove it once the response has been sent."""
    if job.status != "succeeded":
        raise ResultNotReadyError(
            f"The registration is {job.status}; only a result can be applied."
        )
    blobs = (job.result_sha256, job.source.sha256, job.target.sha256)
    result, *clouds = (None if blob is None else runtime.blobs.path(blob) for blob in blobs)
    if result is None or not all(path and path.exists() for path in (result, *clouds)):
        raise ExpiredError("The result or a cloud has expired; register the clouds again.")
    transform = json.loads(result.read_bytes())["transform"]
    with runtime.exporter.export(job, transform, format=format, merged=merged) as path:
        yield path


@router.get(
    "/{job_id}/aligned",
    operation_id="getAligned",
    summary="Fetch the source in the target's frame",
    response_class=FileResponse,
    responses={
        200: {
            "content": {FILE: {"schema": {"type": "string", "format": "binary"}}},
            "description": "The moved source, in the order of its file. Attributes of PLY, PCD, "
            "LAS and LAZ files are kept as far as the format can hold them, normals are turned.",
        }
    },
)
def aligned(job: RequestedJob, path: Annotated[Path, Depends(_export)]) -> FileResponse:
    """Write the file on demand, in a process of its own."""
    return FileResponse(path, media_type=FILE, filename=f"{job.id}-{path.name}")
