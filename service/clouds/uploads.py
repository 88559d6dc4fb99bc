"""Uploads that arrive in pieces and go on after a cut connection."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import BinaryIO
from uuid import uuid4

from sqlalchemy import delete, insert, select, update

from service.clouds.store import CloudStore
from service.database.engine import Database
from service.database.tables import uploads
from service.problems import ServiceError, UnknownUploadError, UploadConflictError


@dataclass(frozen=True, slots=True)
class Upload:
    """An upload; times in seconds since the epoch, UTC."""

    id: str
    tenant: str
    length: int
    """Bytes of the whole file."""
    is_complete: bool
    """Whether it has become a cloud."""
    expires_at: float
    format: str | None
    """As declared by the caller."""


class UploadStore:
    """Uploads in the database, their bytes in files; one that lies still is dropped."""

    def __init__(
        self, database: Database, clouds: CloudStore, directory: Path, *, retention_s: float
    ) -> None:
        self._database = database
        self._clouds = clouds
        self._directory = directory
        self._retention_s = retention_s
        directory.mkdir(exist_ok=True)

    def create(self, tenant: str, length: int, declared: str | None = None) -> Upload:
        """Begin a tenant's upload of this many bytes."""
        expires_at = time.time() + self._retention_s
        upload = Upload(str(uuid4()), tenant, length, False, expires_at, declared)
        self.path(upload).touch()
        with self._database.write() as connection:
            connection.execute(insert(uploads).values(**asdict(upload)))
        return upload

    def get(self, tenant: str, upload_id: str) -> Upload:
        """The tenant's upload; UnknownUploadError when there is none."""
        with self._database.read() as connection:
            query = select(uploads).where(uploads.c.id == upload_id, uploads.c.tenant == tenant)
            row = connection.execute(query).one_or_none()
        if row is None:
            raise _unknown()
        return Upload(**row._mapping)

    def path(self, upload: Upload) -> Path:
        """Where its bytes are kept until it is complete."""
        return self._directory / upload.id

    def offset(self, upload: Upload) -> int:
        """Bytes that have arrived; UnknownUploadError when it has expired meanwhile."""
        try:
            return upload.length if upload.is_complete else self.path(upload).stat().st_size
        except FileNotFoundError as error:
            raise _unknown() from error

    @contextmanager
    def appending(self, upload: Upload, offset: int) -> Iterator[BinaryIO]:
        """The file, to append to from the offset; locked meanwhile, in whatever process.

        UploadConflictError when the upload is elsewhere, or another request appends to it;
        UnknownUploadError when it has expired meanwhile.
        """
        if upload.is_complete:
            raise _elsewhere(upload.length)
        with self._opened(upload) as file:
            if not _lock(file):
                raise UploadConflictError("Another request appends to this upload.")
            if offset != self.offset(upload):
                raise _elsewhere(self.offset(upload))
            file.seek(offset)
            yield file

    def _opened(self, upload: Upload) -> BinaryIO:
        """Its file, which is never made anew: nothing would remove it."""
        try:
            return self.path(upload).open("r+b")
        except FileNotFoundError as error:
            raise _unknown() from error

    def finish_piece(self, upload: Upload) -> Upload:
        """Finish a piece: turn an upload that is complete into the cloud of the same id.

        It gets one more retention period either way. An upload that is not a cloud is removed, and
        the error of `CloudStore.put` raised.
        """
        is_complete = self.offset(upload) == upload.length
        if is_complete:
            try:
                self._clouds.adopt(upload.tenant, upload.id, self.path(upload), upload.format)
            except (ServiceError, ValueError):
                self.remove(upload)
                raise
        values = {"is_complete": is_complete, "expires_at": time.time() + self._retention_s}
        change = update(uploads).where(uploads.c.id == upload.id).values(**values)
        with self._database.write() as connection:
            connection.execute(change)
        return self.get(upload.tenant, upload.id)

    def remove(self, upload: Upload) -> None:
        """Forget it, and drop its bytes."""
        with self._database.write() as connection:
            connection.execute(delete(uploads).where(uploads.c.id == upload.id))
        self.path(upload).unlink(missing_ok=True)

    def drop_expired(self) -> None:
        """Remove the uploads whose time has come."""
        late = select(uploads).where(uploads.c.expires_at < time.time())
        with self._database.read() as connection:
            expired = [Upload(**row._mapping) for row in connection.execute(late)]
        for upload in expired:
            if upload.is_complete:
                self.remove(upload)
                continue
            with self.path(upload).open("ab") as file:
                if _lock(file):
                    self.remove(upload)


def _lock(file: BinaryIO) -> bool:
    """Whether nobody else held the file; it is held until it is closed."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _unknown() -> UnknownUploadError:
    return UnknownUploadError("No upload has this id; it may have expired.")


def _elsewhere(offset: int) -> UploadConflictError:
    return UploadConflictError(
        f"Upload-Offset must be {offset}, the number of bytes received so far."
    )
