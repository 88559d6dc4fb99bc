"""/v1/clouds: stored clouds, which registrations refer to by id."""

from __future__ import annotations

from typing import Annotated, Any
from uuid import uuid4

from fastapi import APIRouter, Path, Response
from starlette.concurrency import run_in_threadpool
from starlette.convertors import StringConvertor, register_url_convertor

from service.api.dependencies import (
    CurrentCaller,
    CurrentRuntime,
    DeclaredFormat,
    RawBody,
    RequestedPage,
)
from service.database.pagination import cut_page
from service.schemas import Cloud, CloudPage


class _CloudIdConvertor(StringConvertor):
    """Any segment of a path but the one of `service.api.routes.direct`."""

    regex = "(?!presign(?:/|$))[^/]+"


register_url_convertor("cloud", _CloudIdConvertor())

router = APIRouter(prefix="/v1/clouds", tags=["clouds"])

CloudId = Annotated[str, Path(pattern=r"^[A-Za-z0-9._-]{1,64}$", description="Id of the cloud.")]
_FILE_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.post(
    "",
    operation_id="createCloud",
    summary="Store a cloud",
    status_code=201,
    openapi_extra=_FILE_BODY,
)
async def create(
    blob: RawBody,
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    response: Response,
    format: DeclaredFormat = None,
) -> Cloud:
    """Store the body, which is the file itself; the response contains the new id."""
    cloud = await put(str(uuid4()), blob, runtime, caller, format)
    response.headers["Location"] = f"{router.prefix}/{cloud.id}"
    return cloud


@router.put(
    "/{cloud_id:cloud}",
    operation_id="putCloud",
    summary="Store a cloud under an id of the caller's choice",
    openapi_extra=_FILE_BODY,
)
async def put(
    cloud_id: CloudId,
    blob: RawBody,
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    format: DeclaredFormat = None,
) -> Cloud:
    """Store the body, which is the file itself; it replaces an earlier cloud of this id."""
    stored = await run_in_threadpool(runtime.clouds.put, caller.tenant, cloud_id, blob, format)
    return Cloud.model_validate(stored)


@router.get("", operation_id="listClouds", summary="List clouds, newest first")
def list_clouds(runtime: CurrentRuntime, caller: CurrentCaller, page: RequestedPage) -> CloudPage:
    """Return one page; follow `next_cursor` until it is null."""
    rows = runtime.clouds.page(caller.tenant, limit=page.limit + 1, before=page.before)
    items, next_cursor = cut_page(rows, page.limit)
    return CloudPage.model_validate({"items": items, "next_cursor": next_cursor})


@router.get("/{cloud_id:cloud}", operation_id="getCloud", summary="Look at a cloud")
def get(cloud_id: CloudId, runtime: CurrentRuntime, caller: CurrentCaller) -> Cloud:
    """Return size, hash, format and expiry of the cloud."""
    return Cloud.model_validate(runtime.clouds.get(caller.tenant, cloud_id))


@router.delete(
    "/{cloud_id:cloud}", operation_id="deleteCloud", summary="Delete a cloud", status_code=204
)
def delete(cloud_id: CloudId, runtime: CurrentRuntime, caller: CurrentCaller) -> None:
    """Delete the cloud; registrations that use it keep its file until they have ended."""
    runtime.clouds.remove(caller.tenant, cloud_id)
