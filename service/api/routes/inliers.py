"""/v1/registrations/{id}/inliers: every inlier pair, as JSON or as a NumPy file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, Header, Query, Response
from fastapi.responses import FileResponse, StreamingResponse
from numpy.typing import NDArray

from service.api.dependencies import CurrentService, KnownJob
from service.problems import ExpiredError, NotAcceptableError, ResultNotReadyError
from service.schemas import InlierList

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

NPY = "application/x-npy"
ROWS_AT_ONCE = 50_000


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
def inliers(
    job: KnownJob,
    service: CurrentService,
    format: Annotated[
        Literal["json", "npy"] | None, Query(description="Goes before the Accept header.")
    ] = None,
    accept: Annotated[str, Header(include_in_schema=False)] = "*/*",
) -> Response:
    """As JSON, or with `?format=npy` or `Accept: application/x-npy` as a NumPy file."""
    if job.status == "succeeded" and job.result_sha256 is None:
        raise ExpiredError("The result has expired; register the clouds again.")
    if job.inliers_sha256 is None or job.result_sha256 is None:
        raise ResultNotReadyError(f"The registration is {job.status}; only a result has inliers.")
    array = service.blobs.path(job.inliers_sha256)
    if (format or _accepted(accept)) == "npy":
        return FileResponse(array, media_type=NPY, filename=f"{job.id}-inliers.npy")
    rows = np.load(array, mmap_mode="r", allow_pickle=False)
    result = json.loads(service.blobs.path(job.result_sha256).read_bytes())
    return StreamingResponse(
        _as_json(rows, result["inliers"]["threshold"]), media_type="application/json"
    )


def _accepted(accept: str) -> Literal["json", "npy"]:
    wanted = [part.partition(";")[0].strip().lower() for part in accept.split(",")]
    if NPY in wanted:
        return "npy"
    if not {"application/json", "application/*", "*/*"}.isdisjoint(wanted):
        return "json"
    raise NotAcceptableError(f"There are application/json and {NPY}.")


def _as_json(rows: NDArray[np.void], threshold: float) -> Iterator[str]:
    """The document, a bounded number of rows in memory at a time."""
    yield f'{{"count":{len(rows)},"threshold":{json.dumps(threshold)},"pairs":['
    yield from _joined(rows, lambda part: np.column_stack((part["source"], part["target"])))
    yield '],"distances":['
    yield from _joined(rows, lambda part: part["distance"])
    yield "]}"


def _joined(
    rows: NDArray[np.void], column: Callable[[NDArray[np.void]], NDArray[Any]]
) -> Iterator[str]:
    for start in range(0, len(rows), ROWS_AT_ONCE):
        values = column(rows[start : start + ROWS_AT_ONCE]).tolist()
        yield ("," if start else "") + json.dumps(values, separators=(",", ":"))[1:-1]
