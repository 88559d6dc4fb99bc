"""/v1/registrations/{id}/inliers: all inlier pairs, as JSON or as a NumPy file."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from typing import Annotated, Literal

from fastapi import APIRouter, Header, Query, Response
from fastapi.responses import StreamingResponse

from service.api.accept import preferred_type
from service.api.dependencies import CurrentRuntime, RequestedJob
from service.api.download import DownloadResponse
from service.api.middleware.conditional import NOT_MODIFIED, is_known
from service.api.threads import OwnThreads
from service.problems import ExpiredError, NotAcceptableError, ResultNotReadyError
from service.schemas import InlierList
from service.schemas.inlier_file import read_inliers
from service.schemas.serialize_result import iter_inliers_json, read_summary

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

NPY = "application/x-npy"
_RENDERING = OwnThreads(1)


@router.get(
    "/{job_id}/inliers",
    operation_id="getInliers",
    summary="Fetch all inlier pairs",
    response_model=InlierList,
    responses={
        200: {
            "content": {NPY: {"schema": {"type": "string", "format": "binary"}}},
            "description": "The pairs by source index. As .npy: one structured array with the "
            "fields source, target (int64) and distance (float64, in the input's unit).",
        }
    },
)
def get_inliers(
    job: RequestedJob,
    runtime: CurrentRuntime,
    format: Annotated[
        Literal["json", "npy"] | None, Query(description="Overrides the Accept header.")
    ] = None,
    accept: Annotated[str, Header(include_in_schema=False)] = "*/*",
    if_none_match: Annotated[str, Header(include_in_schema=False)] = "",
) -> Response:
    """Return JSON, or a NumPy file for `?format=npy` or `Accept: application/x-npy`."""
    if job.status == "succeeded" and job.result_sha256 is None:
        raise ExpiredError("The result has expired; register the clouds again.")
    if job.inliers_sha256 is None or job.result_sha256 is None:
        raise ResultNotReadyError(f"The registration is {job.status}; only a result has inliers.")
    try:
        array, document = map(runtime.blobs.fetch, (job.inliers_sha256, job.result_sha256))
    except FileNotFoundError:
        raise ExpiredError(
            "The result is missing in the store; register the clouds again."
        ) from None
    if (format or _preferred_format(accept)) == "npy":
        return DownloadResponse(
            array,
            media_type=NPY,
            filename=f"{job.id}-inliers.npy",
            headers={"ETag": f'"{job.inliers_sha256}"'},
        )
    headers = {"ETag": f'"{job.inliers_sha256}-json"'}
    if is_known(headers["ETag"], if_none_match):
        return Response(status_code=NOT_MODIFIED, headers=headers)
    rows = read_inliers(array)
    summary = read_summary(document.read_bytes())
    chunks = iter_inliers_json(rows, summary["inliers"]["threshold"])
    return StreamingResponse(_render(chunks), media_type="application/json", headers=headers)


async def _render(chunks: Iterator[str]) -> AsyncIterator[str]:
    """Yield the chunks; all responses together use one thread, which leaves turns to others."""
    while (chunk := await _RENDERING.run(lambda: next(chunks, None))) is not None:
        yield chunk


def _preferred_format(accept: str) -> Literal["json", "npy"]:
    kind = preferred_type(accept, ("application/json", NPY))
    if kind is None:
        raise NotAcceptableError(f"The inliers are available as application/json and {NPY}.")
    return "npy" if kind == NPY else "json"
