"""/v1/registrations/{id}/aligned: the source in the target's frame, as a file."""

from __future__ import annotations

import fcntl
import json
import tempfile
import threading
from typing import Annotated, Literal

from fastapi import APIRouter, Query
from fastapi.responses import FileResponse
from starlette.background import BackgroundTask

from service.api.dependencies import CurrentRuntime, RequestedJob
from service.problems import ExpiredError, ResultNotReadyError
from service.workers.export import Alignment, write_aligned

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

FILE = "application/octet-stream"
_at_once = threading.BoundedSemaphore(2)  # each takes the memory of two decoded clouds


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
def aligned(
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
) -> FileResponse:
    """Written when it is asked for, by a process of its own."""
    if job.status != "succeeded":
        raise ResultNotReadyError(
            f"The registration is {job.status}; only a result can be applied."
        )
    paths = [runtime.blobs.path(sha) for sha in (job.result_sha256, job.source.sha256) if sha]
    target = runtime.blobs.path(job.target.sha256) if job.target.sha256 else None
    if len(paths) < 2 or target is None or not all(path.exists() for path in (*paths, target)):
        raise ExpiredError("The result or a cloud has expired; register the clouds again.")
    output = tempfile.NamedTemporaryFile(dir=runtime.blobs.incoming, prefix="aligned-")  # noqa: SIM115
    fcntl.flock(output, fcntl.LOCK_EX)  # or a service that starts takes it for a dead one's
    alignment = Alignment(
        transform=json.loads(paths[0].read_bytes())["transform"],
        source=str(paths[1]),
        source_reading=job.source.reading,
        target=str(target) if merged else None,
        target_reading=job.target.reading,
        format=format,
        output=output.name,
        memory_bytes=runtime.settings.job_memory_bytes,
        timeout_s=runtime.settings.job_timeout_s,
    )
    try:
        with _at_once:
            write_aligned(alignment)
    except BaseException:
        output.close()
        raise
    return FileResponse(
        output.name,
        media_type=FILE,
        filename=f"{job.id}-aligned.{format}",
        background=BackgroundTask(output.close),
    )
