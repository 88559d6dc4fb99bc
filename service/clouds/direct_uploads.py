"""Files that go from callers to the bucket and back by signed URLs, past the service.

A caller announces the length and the hash of a file, sends it to the URL, and says when it has
arrived. The service copies it to a key that the caller cannot write to, reads the copy, and makes
it a cloud if it is what was announced. Nothing else ever reads what the caller can still change.
"""

from __future__ import annotations

import secrets
from dataclasses import asdict
from uuid import uuid4

from sqlalchemy import delete, insert, select, update

from service.clouds.store import CloudStore, StoredCloud
from service.clouds.uploads import Upload, find_upload
from service.database.clock import now, read_time
from service.database.engine import Database
from service.database.tables import uploads
from service.formats import UnknownFormatError
from service.problems import (
    InvalidRequestError,
    NoDirectTransferError,
    UploadConflictError,
)
from service.storage.blobs import Blob
from service.storage.bucket import Bucket
from service.storage.s3_blobs import S3BlobStore, WrongContentError

URL_LIFETIME_S = 600.0
"""Time for which a signed URL begins a transfer, in seconds; a transfer that has begun goes on."""
PREFIX = "direct/"


class DirectUploads:
    """Uploads to the bucket of all tenants; each is a row, and at most two objects."""

    def __init__(
        self,
        database: Database,
        clouds: CloudStore,
        bucket: Bucket,
        blobs: S3BlobStore,
        *,
        retention_s: float,
    ) -> None:
        self._database = database
        self._clouds = clouds
        self._bucket = bucket
        self._blobs = blobs
        self._retention_s = retention_s

    def create(self, tenant: str, file: Blob, declared: str | None = None) -> tuple[Upload, str]:
        """Begin the upload of an announced file; return it and the URL to PUT the file to."""
        with self._database.write() as connection:
            expires_at = read_time(connection) + self._retention_s
            upload = Upload(
                str(uuid4()), tenant, file.size, False, expires_at, declared, sha256=file.sha256
            )
            connection.execute(insert(uploads).values(**asdict(upload)))
        return upload, self._bucket.sign("PUT", _sent(upload.id), seconds=URL_LIFETIME_S)

    def get(self, tenant: str, upload_id: str) -> Upload:
        """Return the tenant's upload.

        Raises
        ------
        UnknownUploadError
            There is none of this id.
        """
        with self._database.read() as connection:
            return find_upload(connection, tenant, upload_id, uploads.c.sha256.is_not(None))

    def complete(self, upload: Upload) -> StoredCloud:
        """Make the file that has arrived the tenant's cloud of the same id.

        Raises
        ------
        UploadConflictError
            None has arrived.
        InvalidRequestError, UnknownFormatError
            It is not what was announced, or no cloud; the upload is removed.
        """
        if not upload.is_complete:
            try:
                self._adopt(upload)
            except (InvalidRequestError, UnknownFormatError):
                self._remove(upload)
                raise
        return self._clouds.get(upload.tenant, upload.id)

    def sign_download(self, sha256: str) -> str:
        """Return a URL to GET the file of a stored cloud from.

        Raises
        ------
        FileNotFoundError
            The bucket has no such file.
        """
        self._blobs.touch(sha256)  # so that the newest object outlives the URL
        key = self._blobs.newest_object(sha256)
        return self._bucket.sign("GET", key, seconds=URL_LIFETIME_S)

    def collect(self) -> None:
        """Remove the objects of uploads that have ended, and those longer than announced."""
        found = self._bucket.find_sizes(PREFIX)  # first: an object is no older than its row
        with self._database.read() as connection:
            rows = connection.execute(
                select(uploads.c.id, uploads.c.length).where(
                    uploads.c.sha256.is_not(None), ~uploads.c.is_complete
                )
            )
            allowed = {row.id: row.length for row in rows}
        over = [key for key, size in found.items() if size > allowed.get(key.split("/")[1], -1)]
        if over:
            self._bucket.delete(over)

    def _adopt(self, upload: Upload) -> None:
        assert upload.sha256 is not None  # noqa: S101
        own, file = (
            f"{PREFIX}{upload.id}/{secrets.token_hex(16)}",
            Blob(upload.sha256, upload.length),
        )
        try:
            self._bucket.copy(_sent(upload.id), own)
            self._blobs.adopt_object(own, file)
        except FileNotFoundError:
            raise UploadConflictError(
                "The file has not arrived: PUT it to the URL of the upload, and then repeat this."
            ) from None
        except WrongContentError as error:
            raise InvalidRequestError(
                f"The file is not the one that was announced: {error}. Begin again."
            ) from None
        self._clouds.put(upload.tenant, upload.id, file, upload.format)
        with self._database.write() as connection:
            done = {"is_complete": True, "expires_at": now() + self._retention_s}
            connection.execute(update(uploads).where(uploads.c.id == upload.id).values(**done))
        self._bucket.delete([own, _sent(upload.id)])

    def _remove(self, upload: Upload) -> None:
        """Delete the upload; its objects are collected once the row is gone."""
        with self._database.write() as connection:
            connection.execute(delete(uploads).where(uploads.c.id == upload.id))


def require_direct(direct: DirectUploads | None) -> DirectUploads:
    """Return the direct uploads.

    Raises
    ------
    NoDirectTransferError
        There are none.
    """
    if direct is None:
        raise NoDirectTransferError(
            "Files pass through this service: send them to POST /v1/clouds, or in pieces to"
            " POST /v1/uploads. (MPE_BLOB_URL and MPE_BLOB_PUBLIC_ENDPOINT would turn it on.)"
        )
    return direct


def _sent(upload_id: str) -> str:
    """Return the key that the caller writes to."""
    return f"{PREFIX}{upload_id}/sent"
