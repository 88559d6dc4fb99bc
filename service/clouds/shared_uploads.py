"""Uploads whose pieces are blobs, so that any service on the database goes on with them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from sqlalchemy import and_, select, update

from service.clouds.store import CloudStore
from service.clouds.uploads import Upload, UploadStore, try_lock, wrong_offset
from service.database.clock import now
from service.database.engine import Database
from service.database.tables import uploads
from service.problems import UnknownUploadError, UploadConflictError
from service.storage.blobs import BlobStore
from service.storage.file_lock import is_unlocked

CHUNK_BYTES = 1 << 20


class SharedUploadStore(UploadStore):
    """Uploads of a database and a bucket that many services share.

    A piece is a blob once it has ended; the row lists the pieces. The file in the directory is what
    this service has of them.
    """

    def __init__(
        self,
        database: Database,
        clouds: CloudStore,
        blobs: BlobStore,
        directory: Path,
        *,
        retention_s: float,
    ) -> None:
        super().__init__(database, clouds, directory, retention_s=retention_s)
        self._blobs = blobs
        self._begun: dict[str, Upload] = {}

    def offset(self, upload: Upload) -> int:
        """Return the number of bytes received so far, those that arrive here now included."""
        current = self.get(upload.tenant, upload.id)
        if current.is_complete:
            return current.length
        try:
            with self._path(upload).open("r+b") as file:
                return current.received if try_lock(file) else os.fstat(file.fileno()).st_size
        except FileNotFoundError:
            return current.received

    @contextmanager
    def open_at(self, upload: Upload, offset: int) -> Iterator[BinaryIO]:
        """Open the file to append from the offset, with the pieces that other services have."""
        self.get(upload.tenant, upload.id)  # nothing is made for one that has been removed
        self._path(upload).touch()
        with self._path(upload).open("r+b") as file:
            if not try_lock(file):
                raise UploadConflictError("Another request appends to this upload; retry later.")
            current = self.get(upload.tenant, upload.id)
            if current.is_complete or offset != current.received:
                raise wrong_offset(current.length if current.is_complete else current.received)
            self._restore(file, current)
            self._begun[upload.id] = current
            try:
                yield file
            finally:
                del self._begun[upload.id]

    def finish_piece(self, upload: Upload) -> Upload:
        """Store the piece that was appended as a blob, and complete the upload after the last one.

        Raises
        ------
        UploadConflictError
            Another service has stored a piece from the same offset meanwhile.
        """
        before = self._begun[upload.id]
        end = self._path(upload).stat().st_size
        is_complete = end == upload.length
        pieces = before.pieces
        if end > before.received:
            pieces = [*pieces, self._store_piece(upload, before.received)]
        if is_complete:
            self._complete(upload)
        values = {
            "received": end,
            "pieces": [] if is_complete else pieces,
            "is_complete": is_complete,
            "expires_at": now() + self._retention_s,
        }
        is_own_turn = and_(uploads.c.id == upload.id, uploads.c.received == before.received)
        with self._database.write() as connection:
            done = connection.execute(update(uploads).where(is_own_turn).values(**values)).rowcount
        if not done:
            raise UploadConflictError("Another request appends to this upload; retry later.")
        return self.get(upload.tenant, upload.id)

    def drop_expired(self) -> None:
        """Remove the expired uploads, and the files of those that other services have ended."""
        super().drop_expired()
        query = select(uploads.c.id).where(~uploads.c.is_complete)
        with self._database.read() as connection:
            unfinished = set(connection.scalars(query))
        for path in self._directory.iterdir():
            if path.name not in unfinished and is_unlocked(path):
                path.unlink(missing_ok=True)

    def _store_piece(self, upload: Upload, start: int) -> dict[str, str | int]:
        with self._path(upload).open("rb") as file:
            file.seek(start)
            blob = self._blobs.put(iter(lambda: file.read(CHUNK_BYTES), b""))
        return {"sha256": blob.sha256, "size": blob.size}

    def _restore(self, file: BinaryIO, upload: Upload) -> None:
        """Make the file hold the pieces and nothing more, and go to its end."""
        file.truncate(min(upload.received, os.fstat(file.fileno()).st_size))
        if file.seek(0, os.SEEK_END) == upload.received:
            return
        file.seek(0)
        file.truncate()
        for piece in upload.pieces:
            try:
                with self._blobs.hold(piece["sha256"]) as path, path.open("rb") as stored:
                    shutil.copyfileobj(stored, file, CHUNK_BYTES)
            except FileNotFoundError:
                raise UnknownUploadError("The upload was lost; begin again.") from None
        file.flush()
