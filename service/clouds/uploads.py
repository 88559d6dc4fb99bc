"""Uploads that arrive in pieces and go on after a broken connection; then they become clouds."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, BinaryIO
from uuid import uuid4

from sqlalchemy import ColumnElement, Connection, and_, delete, insert, select, update

from service.clouds.store import CloudStore
from service.database.clock import now, read_time
from service.database.engine import Database
from service.database.tables import uploads
from service.problems import ServiceError, UnknownUploadError, UploadConflictError


@dataclass(frozen=True, slots=True)
class Upload:
    """A row of the uploads table; times in seconds since the epoch, UTC."""

    id: str
    tenant: str
    length: int
    """Bytes of the whole file."""
    is_complete: bool
    """Whether it has become the cloud of the same id."""
    expires_at: float
    format: str | None
    """As declared by the caller."""
    received: int = 0
    """Bytes of all pieces that are blobs."""
    pieces: list[dict[str, Any]] = field(default_factory=list)
    """Hash and size of each piece that is a blob, in order."""
    sha256: str | None = None
    """Hash of the file, as announced, where it goes to the bucket directly; None: in pieces."""


class UploadStore:
    """Uploads of all tenants: rows in the database, and a file for each incomplete one.

    An upload that receives nothing for `retention_s` seconds expires.
    """

    def __init__(
        self, database: Database, clouds: CloudStore, directory: Path, *, retention_s: float
    ) -> None:
        self._database = database
        self._clouds = clouds
        self._directory = directory
        self._retention_s = retention_s
        directory.mkdir(exist_ok=True)

    def create(self, tenant: str, length: int, declared: str | None = None) -> Upload:
        """Begin an upload of `length` bytes, in the declared format or one of its content."""
        with self._database.write() as connection:
            expires_at = read_time(connection) + self._retention_s
            upload = Upload(str(uuid4()), tenant, length, False, expires_at, declared)
            self._path(upload).touch()
            connection.execute(insert(uploads).values(**asdict(upload)))
        return upload

    def get(self, tenant: str, upload_id: str) -> Upload:
        """Return the tenant's upload.

        Raises
        ------
        UnknownUploadError
            There is none of this id.
        """
        with self._database.read() as connection:
            return find_upload(connection, tenant, upload_id, uploads.c.sha256.is_(None))

    def offset(self, upload: Upload) -> int:
        """Return the number of bytes received so far.

        Raises
        ------
        UnknownUploadError
            The upload has expired meanwhile.
        """
        try:
            return upload.length if upload.is_complete else self._path(upload).stat().st_size
        except FileNotFoundError as error:
            raise unknown_upload() from error

    @contextmanager
    def open_at(self, upload: Upload, offset: int) -> Iterator[BinaryIO]:
        """Open the file to append from the offset; locked meanwhile, for all processes.

        Raises
        ------
        UploadConflictError
            The offset is not that of the upload, or another request appends to it.
        UnknownUploadError
            The upload has expired meanwhile.
        """
        if upload.is_complete:
            raise wrong_offset(upload.length)
        with self._open(upload) as file:
            if not try_lock(file):
                raise UploadConflictError("Another request appends to this upload; retry later.")
            if offset != self.offset(upload):
                raise wrong_offset(self.offset(upload))
            file.seek(offset)
            yield file

    def finish_piece(self, upload: Upload) -> Upload:
        """Postpone the expiry of an upload after a piece, and complete it after the last one.

        A complete upload becomes the tenant's cloud of the same id; one that is no cloud is
        removed. Called while `open_at` holds the file.

        Raises
        ------
        UnknownFormatError
            The content matches no format.
        """
        is_complete = self.offset(upload) == upload.length
        if is_complete:
            self._complete(upload)
        values = {"is_complete": is_complete, "expires_at": now() + self._retention_s}
        with self._database.write() as connection:
            connection.execute(update(uploads).where(uploads.c.id == upload.id).values(**values))
        return self.get(upload.tenant, upload.id)

    def _complete(self, upload: Upload) -> None:
        """Make the received file the tenant's cloud of the same id."""
        try:
            self._clouds.adopt(upload.tenant, upload.id, self._path(upload), upload.format)
        except (ServiceError, ValueError):
            self.remove(upload)
            raise

    def remove(self, upload: Upload) -> None:
        """Delete the upload and what has been received; a cloud that it has become stays.

        The file goes first: on a full disk its row can be deleted only then.
        """
        self._path(upload).unlink(missing_ok=True)
        with self._database.write() as connection:
            connection.execute(delete(uploads).where(uploads.c.id == upload.id))

    def drop_expired(self) -> None:
        """Remove the expired uploads, except those that receive a piece at this moment."""
        is_expired = uploads.c.expires_at < now()
        with self._database.read() as connection:
            rows = connection.execute(select(uploads).where(is_expired))
            expired = [Upload(**row._mapping) for row in rows]
        for upload in expired:
            try:
                with self._open(upload) as file:
                    if try_lock(file):
                        self.remove(upload)
            except UnknownUploadError:  # it is complete, or its file has been removed
                self.remove(upload)

    def _path(self, upload: Upload) -> Path:
        return self._directory / upload.id

    def _open(self, upload: Upload) -> BinaryIO:
        """Open the upload's file, which is never made anew: nothing would remove it."""
        try:
            return self._path(upload).open("r+b")
        except FileNotFoundError as error:
            raise unknown_upload() from error


def try_lock(file: BinaryIO) -> bool:
    """Lock the file until it is closed; return False when somebody else holds it."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def find_upload(
    connection: Connection, tenant: str, upload_id: str, *conditions: ColumnElement[bool]
) -> Upload:
    """Return the tenant's upload.

    Raises
    ------
    UnknownUploadError
        There is none of this id.
    """
    is_own = and_(uploads.c.id == upload_id, uploads.c.tenant == tenant)
    row = connection.execute(select(uploads).where(is_own, *conditions)).one_or_none()
    if row is None:
        raise unknown_upload()
    return Upload(**row._mapping)


def unknown_upload() -> UnknownUploadError:
    """Return the error of an id that no upload of the tenant has."""
    return UnknownUploadError("No upload has this id; it may have expired.")


def wrong_offset(expected: int) -> UploadConflictError:
    """Return the error of a piece that does not begin where the last one ended."""
    return UploadConflictError(
        f"Upload-Offset must be {expected}, the number of bytes received so far."
    )
