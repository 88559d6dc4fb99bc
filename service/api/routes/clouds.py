"""/v1/clouds: clouds to refer to."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated, Any
from uuid import uuid4

from fastapi import APIRouter, Path, Query, Response
from starlette.concurrency import run_in_threadpool

from service.api.dependencies import CurrentCaller, CurrentService, DeclaredFormat, RawBody
from service.clouds.store import StoredCloud
from service.database.pagination import CURSOR, decode_cursor, encode_cursor
from service.schemas import Cloud, CloudPage

router = APIRouter(prefix="/v1/clouds", tags=["clouds"])

CloudId = Annotated[str, Path(pattern=r"^[A-Za-z0-9._-]{1,64}$", description="Id of the cloud.")]
_FILE: dict[str, Any] = {
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
    openapi_extra=_FILE,
)
async def create(
    blob: RawBody,
    service: CurrentService,
    caller: CurrentCaller,
    response: Response,
    format: DeclaredFormat = None,
) -> Cloud:
    """The body is the file itself; the answer names the id to refer to it by."""
    put = service.clouds.put
    cloud = await run_in_threadpool(put, caller.tenant, str(uuid4()), blob, format)
    response.headers["Location"] = f"{router.prefix}/{cloud.id}"
    return _document(cloud)


@router.put(
    "/{cloud_id}",
    operation_id="putCloud",
    summary="Store a cloud under an id of the caller's own",
    openapi_extra=_FILE,
)
async def put(
    cloud_id: CloudId,
    blob: RawBody,
    service: CurrentService,
    caller: CurrentCaller,
    format: DeclaredFormat = None,
) -> Cloud:
    """The body is the file itself; it takes the place of a former cloud of this id."""
    stored = await run_in_threadpool(service.clouds.put, caller.tenant, cloud_id, blob, format)
    return _document(stored)


@router.get("", operation_id="listClouds", summary="List clouds, newest first")
def list_page(
    service: CurrentService,
    caller: CurrentCaller,
    limit: Annotated[int, Query(ge=1, le=200, description="Most items of the page.")] = 50,
    cursor: Annotated[
        str | None, Query(pattern=CURSOR, description="next_cursor of the page before.")
    ] = None,
) -> CloudPage:
    """Follow `next_cursor` until it is null."""
    before = None if cursor is None else decode_cursor(cursor)
    found = service.clouds.page(caller.tenant, limit=limit + 1, before=before)
    more = encode_cursor(found[limit - 1]) if len(found) > limit else None
    return CloudPage(items=[_document(cloud) for cloud in found[:limit]], next_cursor=more)


@router.get("/{cloud_id}", operation_id="getCloud", summary="Look at a cloud")
def get(cloud_id: CloudId, service: CurrentService, caller: CurrentCaller) -> Cloud:
    """What is known of it."""
    return _document(service.clouds.get(caller.tenant, cloud_id))


@router.delete("/{cloud_id}", operation_id="deleteCloud", summary="Remove a cloud", status_code=204)
def delete(cloud_id: CloudId, service: CurrentService, caller: CurrentCaller) -> None:
    """Registrations that were given it keep it until they have ended."""
    service.clouds.remove(caller.tenant, cloud_id)


def _document(cloud: StoredCloud) -> Cloud:
    return Cloud(
        id=cloud.id,
        sha256=cloud.sha256,
        size=cloud.size,
        format=cloud.format,
        created_at=datetime.fromtimestamp(cloud.created_at, UTC),
        expires_at=datetime.fromtimestamp(cloud.expires_at, UTC),
    )
