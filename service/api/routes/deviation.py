"""/v1/registrations/{id}/deviation: how far the moved source lies from its target."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import AbstractContextManager
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response
from starlette.concurrency import run_in_threadpool

from service.api.dependencies import CurrentCaller, CurrentRuntime, RequestedJob
from service.api.export import exported_file, require_pair
from service.api.middleware.conditional import NOT_MODIFIED
from service.clouds.deviation import MAX_TOLERANCES
from service.jobs.fingerprint import hash_json
from service.jobs.model import JobRow
from service.runtime import Runtime
from service.schemas import Deviation
from service.workers.export_deviation import ExportDeviation
from service.workers.exporter import ExportedFile

router = APIRouter(prefix="/v1/registrations", tags=["registrations"])

Length = Annotated[float, Query(gt=0, allow_inf_nan=False)]
Tolerances = Annotated[
    list[Length] | None,
    Query(
        alias="tolerance",
        max_length=MAX_TOLERANCES,
        description="Distances, in the input's unit, for which the share of points within them is "
        "wanted; repeat the parameter for several.",
    ),
]
MaxDistance = Annotated[
    float | None,
    Query(
        gt=0,
        allow_inf_nan=False,
        description="Points farther away do not count, as they have no counterpart.",
    ),
]


async def _tag(
    job: RequestedJob, tolerances: Tolerances = None, max_distance: MaxDistance = None
) -> str:
    """Return the ETag of the document, before it is made."""
    what = [job.work_key, job.result_sha256, "deviation", tolerances, max_distance]
    return f'"{hash_json(what)}"'


Tag = Annotated[str, Depends(_tag)]


async def _export(
    request: Request,
    job: RequestedJob,
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    tag: Tag,
    tolerances: Tolerances = None,
    max_distance: MaxDistance = None,
) -> AsyncIterator[ExportedFile | None]:
    """Write the document; None where the caller has it already."""
    export = await run_in_threadpool(_prepare, job, runtime, tolerances or [], max_distance)
    async with exported_file(request, runtime, caller, tag, export) as file:
        yield file


def _prepare(
    job: JobRow, runtime: Runtime, tolerances: list[float], max_distance: float | None
) -> AbstractContextManager[ExportedFile]:
    pair, _ = require_pair(job, runtime)
    return runtime.exporter.export(
        job, lambda environment: ExportDeviation(environment, pair, tolerances, max_distance)
    )


@router.get(
    "/{job_id}/deviation",
    operation_id="getDeviation",
    summary="Measure the distances of the moved source from its target",
    response_model=Deviation,
)
def deviation(
    job: RequestedJob, file: Annotated[ExportedFile | None, Depends(_export)], tag: Tag
) -> Response:
    """Measure on demand, in a process of its own; not for a caller who has the answer already."""
    if file is None:
        return Response(status_code=NOT_MODIFIED, headers={"ETag": tag})
    document = Deviation.model_validate_json(file.path.read_bytes())
    body = document.model_dump_json()
    return Response(body, media_type="application/json", headers={"ETag": tag})
