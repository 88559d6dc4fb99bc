"""/v1/clouds/presign: files that go to the store and come from it past the service."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request, Response

from service.api.admission import reserve_bytes, reserve_disk
from service.api.dependencies import CurrentCaller, CurrentRuntime
from service.api.disconnect import unless_disconnected
from service.api.json_body import JSON_TYPE, read_json
from service.api.routes.clouds import CloudId
from service.api.threads import OwnThreads
from service.clouds.direct_uploads import URL_LIFETIME_S, require_direct
from service.clouds.store import StoredCloud
from service.problems import BodyTooLargeError, ExpiredError
from service.runtime import MAX_READING
from service.schemas import AnnouncedFile, Cloud, DirectUpload, SignedUrl
from service.storage.blobs import Blob

router = APIRouter(prefix="/v1/clouds", tags=["clouds"])

_READING = OwnThreads(MAX_READING)
_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            JSON_TYPE: {"schema": {"$ref": f"#/components/schemas/{AnnouncedFile.__name__}"}}
        },
    }
}


async def _announced(request: Request, _caller: CurrentCaller) -> AnnouncedFile:
    return await read_json(request, AnnouncedFile)


@router.post(
    "/presign",
    operation_id="createDirectUpload",
    summary="Begin an upload that goes to the store directly",
    status_code=201,
    openapi_extra=_BODY,
)
def create(
    file: Annotated[AnnouncedFile, Depends(_announced)],
    runtime: CurrentRuntime,
    caller: CurrentCaller,
    response: Response,
) -> DirectUpload:
    """Return the URL to PUT the file to; then POST to the Location that the response names."""
    direct, max_bytes = require_direct(runtime.direct_uploads), runtime.settings.max_body_bytes
    if file.size > max_bytes:
        raise BodyTooLargeError(f"The file is longer than the allowed {max_bytes} bytes.")
    with reserve_bytes(runtime, caller, file.size):
        upload, url = direct.create(caller.tenant, Blob(file.sha256, file.size), file.format)
    response.headers["Location"] = f"{router.prefix}/presign/{upload.id}"
    expires_at = datetime.fromtimestamp(upload.expires_at, UTC)
    return DirectUpload(id=upload.id, url=url, url_expires_at=_until(), expires_at=expires_at)


@router.post(
    "/presign/{upload_id}",
    operation_id="completeDirectUpload",
    summary="Make the file that was sent to the store a cloud",
)
async def complete(
    request: Request, upload_id: str, runtime: CurrentRuntime, caller: CurrentCaller
) -> Cloud:
    """Compare the file with the length and hash that were announced, and store it as a cloud."""
    direct = require_direct(runtime.direct_uploads)

    def adopt() -> StoredCloud:
        upload = direct.get(caller.tenant, upload_id)
        with reserve_disk(runtime, upload.length):
            return direct.complete(upload)

    await unless_disconnected(request, runtime.reading_gate.acquire(caller.tenant))
    try:
        return Cloud.model_validate(await _READING.run(adopt))
    finally:
        runtime.reading_gate.release(caller.tenant)


@router.post(
    "/{cloud_id:cloud}/presign",
    operation_id="signCloudDownload",
    summary="Fetch the file of a cloud from the store directly",
)
def sign_download(cloud_id: CloudId, runtime: CurrentRuntime, caller: CurrentCaller) -> SignedUrl:
    """Return a URL to GET the file from."""
    direct = require_direct(runtime.direct_uploads)
    cloud = runtime.clouds.get(caller.tenant, cloud_id)
    try:
        url = direct.sign_download(cloud.sha256)
    except FileNotFoundError:
        raise ExpiredError(
            f"The file of the cloud {cloud.id} is missing in the store; store the cloud again."
        ) from None
    return SignedUrl(url=url, url_expires_at=_until(), sha256=cloud.sha256)


def _until() -> datetime:
    return datetime.fromtimestamp(time.time() + URL_LIFETIME_S, UTC)
