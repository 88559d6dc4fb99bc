"""/v1/uploads: large clouds in pieces, by the tus protocol 1.0 (tus.io).

Extensions: creation, expiration, termination. A complete upload is the cloud of the same id.
"""

from __future__ import annotations

import asyncio
import os
from contextlib import ExitStack
from datetime import UTC, datetime
from email.utils import format_datetime
from functools import partial
from typing import Annotated, Any, BinaryIO

from fastapi import APIRouter, Depends, Header, Request, Response
from starlette.concurrency import run_in_threadpool

from service.api.admission import reserve_bytes, reserve_disk
from service.api.body import iter_body
from service.api.dependencies import CurrentCaller, CurrentRuntime, DeclaredFormat, identify
from service.api.threads import STORING
from service.clouds.uploads import Upload
from service.problems import (
    BodyTooLargeError,
    ConnectionClosedError,
    TusVersionError,
    UnsupportedContentTypeError,
    UploadConflictError,
)
from service.runtime import Runtime

TUS_VERSION = "1.0.0"
EXTENSIONS = "creation,expiration,termination"
PIECE_TYPE = "application/offset+octet-stream"
_TUS: dict[str, Any] = {
    "parameters": [
        {
            "name": "Tus-Resumable",
            "in": "header",
            "required": True,
            "description": "Version of tus that the caller uses.",
            "schema": {"type": "string", "enum": [TUS_VERSION]},
        }
    ]
}
_PIECE: dict[str, Any] = _TUS | {
    "requestBody": {
        "required": True,
        "content": {PIECE_TYPE: {"schema": {"type": "string", "format": "binary"}}},
    }
}


async def _check_tus_version(
    tus_resumable: Annotated[str, Header(include_in_schema=False)] = "",
) -> None:
    if tus_resumable != TUS_VERSION:
        raise TusVersionError(
            f"Send Tus-Resumable: {TUS_VERSION}.", headers={"Tus-Version": TUS_VERSION}
        )


router = APIRouter(prefix="/v1/uploads", tags=["clouds"], dependencies=[Depends(identify)])
requires_tus = [Depends(_check_tus_version)]


@router.options(
    "", operation_id="describeUploads", summary="Supported parts of tus", status_code=204
)
def describe(runtime: CurrentRuntime) -> Response:
    """Return version, extensions and the largest upload, as headers."""
    return _tus_response(
        204,
        {
            "Tus-Version": TUS_VERSION,
            "Tus-Extension": EXTENSIONS,
            "Tus-Max-Size": str(runtime.settings.max_body_bytes),
        },
    )


@router.post(
    "",
    operation_id="createUpload",
    summary="Begin an upload",
    status_code=201,
    dependencies=requires_tus,
    openapi_extra=_TUS,
    response_class=Response,
)
def create(
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    upload_length: Annotated[int, Header(ge=1, description="Size of the whole file in bytes.")],
    format: DeclaredFormat = None,
) -> Response:
    """Return the Location to send the pieces to."""
    max_bytes = runtime.settings.max_body_bytes
    if upload_length > max_bytes:
        raise BodyTooLargeError(f"The file is longer than the allowed {max_bytes} bytes.")
    with reserve_bytes(runtime, caller, upload_length):
        upload = runtime.uploads.create(caller.tenant, upload_length, format)
    return _tus_response(201, {"Location": f"{router.prefix}/{upload.id}", **_expiry(upload)})


@router.head(
    "/{upload_id}",
    operation_id="lookAtUpload",
    summary="How far an upload is",
    dependencies=requires_tus,
    openapi_extra=_TUS,
    response_class=Response,
)
def look(upload_id: str, runtime: CurrentRuntime, caller: CurrentCaller) -> Response:
    """Return the headers Upload-Offset and Upload-Length."""
    upload = runtime.uploads.get(caller.tenant, upload_id)
    return _tus_response(200, {**_state(upload, runtime), "Upload-Length": str(upload.length)})


@router.patch(
    "/{upload_id}",
    operation_id="appendToUpload",
    summary="Send the next piece",
    status_code=204,
    dependencies=requires_tus,
    openapi_extra=_PIECE,
    response_class=Response,
)
async def append(
    upload_id: str,
    request: Request,
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    upload_offset: Annotated[int, Header(ge=0, description="Offset at which the piece begins.")],
) -> Response:
    """Append a piece; if the connection is lost, what has arrived stays: ask with HEAD."""
    if request.headers.get("content-type") != PIECE_TYPE:
        raise UnsupportedContentTypeError(f"Send a piece as {PIECE_TYPE}.")
    upload = await run_in_threadpool(runtime.uploads.get, caller.tenant, upload_id)
    remaining = max(0, upload.length - upload_offset)
    announced = min(remaining, int(request.headers.get("content-length", remaining)))
    if upload_offset == await run_in_threadpool(runtime.uploads.offset, upload):
        await runtime.appends.interrupt(upload.id)  # its caller knows what has arrived: goes on
    with ExitStack() as opened:
        reserved = reserve_disk(runtime, announced)
        await run_in_threadpool(opened.enter_context, reserved)
        appending = runtime.uploads.open_at(upload, upload_offset)
        file = await STORING.run(lambda: opened.enter_context(appending))  # it may fetch pieces
        async with runtime.appends.enter(upload.id) as limit:
            await _write_body(request, file, limit, max_bytes=remaining)
            upload = await STORING.run(partial(runtime.uploads.finish_piece, upload))
    return _tus_response(204, await run_in_threadpool(_state, upload, runtime))


@router.delete(
    "/{upload_id}",
    operation_id="deleteUpload",
    summary="Cancel an upload",
    status_code=204,
    dependencies=requires_tus,
    openapi_extra=_TUS,
    response_class=Response,
)
def delete(upload_id: str, runtime: CurrentRuntime, caller: CurrentCaller) -> Response:
    """Delete what has arrived; a cloud made of a complete upload stays."""
    runtime.uploads.remove(runtime.uploads.get(caller.tenant, upload_id))
    return _tus_response(204, {})


async def _write_body(
    request: Request, file: BinaryIO, limit: asyncio.Timeout, max_bytes: int
) -> None:
    try:
        async with limit:
            async for chunk in iter_body(request, max_bytes):
                await STORING.run(partial(_append, file, chunk))
    except ConnectionClosedError:
        return  # the connection was lost: keep what has arrived
    except TimeoutError:
        raise UploadConflictError("A later request goes on with this upload.") from None
    finally:
        await STORING.run(lambda: os.fsync(file.fileno()))


def _append(file: BinaryIO, chunk: bytes) -> None:
    file.write(chunk)
    file.flush()  # other requests read the offset from the file's length


def _state(upload: Upload, runtime: Runtime) -> dict[str, str]:
    return {"Upload-Offset": str(runtime.uploads.offset(upload)), **_expiry(upload)}


def _expiry(upload: Upload) -> dict[str, str]:
    expires_at = datetime.fromtimestamp(upload.expires_at, UTC)
    return {"Upload-Expires": format_datetime(expires_at, usegmt=True)}


def _tus_response(status: int, headers: dict[str, str]) -> Response:
    always = {"Tus-Resumable": TUS_VERSION, "Cache-Control": "no-store"}
    return Response(status_code=status, headers=always | headers)
