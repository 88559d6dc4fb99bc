"""Copy of the job store as it is at one moment, and the files that this copy names."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import and_, select

from service.backup.manifest import BackedUpFile, hash_file
from service.backup.postgres_programs import DUMP_NAME, dump_database
from service.database.engine import ReadableDatabase
from service.database.postgres import PostgresSnapshot
from service.database.sqlite import SqliteSnapshot
from service.database.tables import uploads
from service.jobs.retention import find_needed_blobs
from service.settings import Settings
from service.storage.blobs import blob_path

_BUSY_TIMEOUT_S = 60.0


@dataclass(frozen=True, slots=True)
class StoreCopy:
    """A copied store."""

    file: BackedUpFile
    """The copy itself."""
    names: list[str]
    """Paths, in the data directory, of all files that the store names."""


def copy_store(settings: Settings, directory: Path) -> StoreCopy:
    """Copy the store into a directory in one transaction.

    Raises
    ------
    BackupError
        PostgreSQL's programs are missing or fail.
    NotReadyError
        The database does not answer.
    """
    if settings.database_url is None:
        return _copy_sqlite(settings, directory / settings.sqlite_path.name)
    return _dump_postgres(settings, directory / DUMP_NAME)


def _copy_sqlite(settings: Settings, target: Path) -> StoreCopy:
    """Copy the database with what is in its write-ahead log."""
    target.unlink(missing_ok=True)
    uri = f"{settings.sqlite_path.absolute().as_uri()}?mode=ro"
    with (
        closing(sqlite3.connect(uri, uri=True, timeout=_BUSY_TIMEOUT_S)) as reader,
        closing(sqlite3.connect(target)) as writer,
    ):
        reader.backup(writer)
        writer.execute("PRAGMA journal_mode=DELETE")  # one file, without a log beside it
    with closing(SqliteSnapshot(target)) as snapshot:
        return StoreCopy(_describe(target), _list_files(settings, snapshot))


def _dump_postgres(settings: Settings, target: Path) -> StoreCopy:
    """Dump the rows of one snapshot, and read the names of the files from the same one."""
    target.unlink(missing_ok=True)
    with closing(PostgresSnapshot(settings.store_url)) as snapshot:
        names = _list_files(settings, snapshot)
        dump_database(settings.store_url, target, snapshot=snapshot.export())
    return StoreCopy(_describe(target), names)


def _list_files(settings: Settings, database: ReadableDatabase) -> list[str]:
    return list(_named_files(database, has_files=settings.blob.url is None))


def _describe(store: Path) -> BackedUpFile:
    with store.open("rb") as copied:
        os.fsync(copied.fileno())
    return BackedUpFile(path=store.name, size=store.stat().st_size, sha256=hash_file(store))


def _named_files(database: ReadableDatabase, *, has_files: bool) -> Iterator[str]:
    """Yield the files that rows name; uploads have files unless their pieces are blobs."""
    blobs = sorted(find_needed_blobs(database))
    in_pieces = and_(uploads.c.is_complete.is_(False), uploads.c.sha256.is_(None))
    query = select(uploads.c.id).where(in_pieces)
    with database.read() as connection:
        pieces = sorted(connection.scalars(query))
    for sha256 in blobs:
        yield str(blob_path(Path(), sha256))
    for upload_id in pieces if has_files else ():
        yield f"uploads/{upload_id}"
