"""/v1/uploads: large clouds in pieces, by the tus protocol 1.0 (tus.io).

Extensions: creation, expiration, termination. A complete upload is the cloud of the same id.
"""

from __future__ import annotations

import os
from datetime import UTC, datetime
from email.utils import format_datetime
from typing import Annotated, Any, BinaryIO

from fastapi import APIRouter, Depends, Header, Request, Response
from starlette.concurrency import run_in_threadpool

from service.api.admission import admit
from service.api.body import limited
from service.api.dependencies import CurrentCaller, CurrentService, DeclaredFormat, identify
from service.clouds.uploads import Upload
from service.problems import (
    BodyTooLargeError,
    MalformedBodyError,
    ServiceError,
    TusVersionError,
    UnsupportedContentTypeError,
)
from service.runtime import Runtime

TUS_VERSION = "1.0.0"
EXTENSIONS = "creation,expiration,termination"
PIECE = "application/offset+octet-stream"
_TUS: dict[str, Any] = {
    "parameters": [
        {
            "name": "Tus-Resumable",
            "in": "header",
            "required": True,
            "description": "Version of tus that the caller speaks.",
            "schema": {"type": "string", "enum": [TUS_VERSION]},
        }
    ]
}
_PIECE: dict[str, Any] = _TUS | {
    "requestBody": {
        "required": True,
        "content": {PIECE: {"schema": {"type": "string", "format": "binary"}}},
    }
}


def _tus(tus_resumable: Annotated[str, Header(include_in_schema=False)] = "") -> None:
    if tus_resumable != TUS_VERSION:
        raise TusVersionError(
            f"Send Tus-Resumable: {TUS_VERSION}.", headers={"Tus-Version": TUS_VERSION}
        )


router = APIRouter(prefix="/v1/uploads", tags=["clouds"], dependencies=[Depends(identify)])
speaks_tus = [Depends(_tus)]


@router.options(
    "", operation_id="describeUploads", summary="What of tus is spoken", status_code=204
)
def describe(service: CurrentService) -> Response:
    """Version, extensions and the largest upload."""
    return _answer(
        204,
        {
            "Tus-Version": TUS_VERSION,
            "Tus-Extension": EXTENSIONS,
            "Tus-Max-Size": str(service.settings.max_body_bytes),
        },
    )


@router.post(
    "",
    operation_id="createUpload",
    summary="Begin an upload",
    status_code=201,
    dependencies=speaks_tus,
    openapi_extra=_TUS,
    response_class=Response,
)
def create(
    service: CurrentService,
    caller: CurrentCaller,
    upload_length: Annotated[int, Header(ge=1, description="Bytes of the whole file.")],
    format: DeclaredFormat = None,
) -> Response:
    """Answers with the Location to send the pieces to."""
    if upload_length > service.settings.max_body_bytes:
        raise BodyTooLargeError(f"It exceeds the {service.settings.max_body_bytes} bytes allowed.")
    admit(service, caller, upload_length)
    try:
        upload = service.uploads.create(caller.tenant, upload_length, format)
    finally:
        service.storage_quota.release(caller, upload_length)
    return _answer(201, {"Location": f"{router.prefix}/{upload.id}", **_expiry(upload)})


@router.head(
    "/{upload_id}",
    operation_id="lookAtUpload",
    summary="How far an upload is",
    dependencies=speaks_tus,
    openapi_extra=_TUS,
    response_class=Response,
)
def look(upload_id: str, service: CurrentService, caller: CurrentCaller) -> Response:
    """In the headers Upload-Offset and Upload-Length."""
    upload = service.uploads.get(caller.tenant, upload_id)
    return _answer(200, {**_state(upload, service), "Upload-Length": str(upload.length)})


@router.patch(
    "/{upload_id}",
    operation_id="appendToUpload",
    summary="Send the next piece",
    status_code=204,
    dependencies=speaks_tus,
    openapi_extra=_PIECE,
    response_class=Response,
)
async def append(
    upload_id: str,
    request: Request,
    service: CurrentService,
    caller: CurrentCaller,
    upload_offset: Annotated[int, Header(ge=0, description="Where the piece begins.")],
) -> Response:
    """What arrives before a cut stays; ask with HEAD where to go on."""
    if request.headers.get("content-type") != PIECE:
        raise UnsupportedContentTypeError(f"A piece is sent as {PIECE}.")
    upload = await run_in_threadpool(service.uploads.get, caller.tenant, upload_id)
    with service.uploads.appending(upload, upload_offset) as file:
        await _receive(request, file, upload.length - upload_offset)
    upload = await run_in_threadpool(_after_piece, service, upload)
    return _answer(204, _state(upload, service))


@router.delete(
    "/{upload_id}",
    operation_id="deleteUpload",
    summary="Give an upload up",
    status_code=204,
    dependencies=speaks_tus,
    openapi_extra=_TUS,
    response_class=Response,
)
def delete(upload_id: str, service: CurrentService, caller: CurrentCaller) -> Response:
    """Drops what has arrived; a cloud that it has become stays."""
    service.uploads.remove(service.uploads.get(caller.tenant, upload_id))
    return _answer(204, {})


async def _receive(request: Request, file: BinaryIO, room: int) -> None:
    try:
        async for chunk in limited(request, room):
            file.write(chunk)
            file.flush()  # its length is how far the upload is, for whoever asks meanwhile
    except MalformedBodyError:
        return  # the connection was cut: what has come is kept
    finally:
        await run_in_threadpool(os.fsync, file.fileno())


def _after_piece(service: Runtime, upload: Upload) -> Upload:
    """Turn a complete upload into a cloud; one that is no cloud is dropped."""
    complete = service.uploads.offset(upload) == upload.length
    if complete:
        blob = service.blobs.adopt(service.uploads.path(upload))
        try:
            service.clouds.put(upload.tenant, upload.id, blob, upload.format)
        except (ServiceError, ValueError):
            service.uploads.remove(upload)
            raise
    return service.uploads.extend(upload, complete=complete)


def _state(upload: Upload, service: Runtime) -> dict[str, str]:
    return {"Upload-Offset": str(service.uploads.offset(upload)), **_expiry(upload)}


def _expiry(upload: Upload) -> dict[str, str]:
    moment = datetime.fromtimestamp(upload.expires_at, UTC)
    return {"Upload-Expires": format_datetime(moment, usegmt=True)}


def _answer(status: int, headers: dict[str, str]) -> Response:
    always = {"Tus-Resumable": TUS_VERSION, "Cache-Control": "no-store"}
    return Response(status_code=status, headers=always | headers)
