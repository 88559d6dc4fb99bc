"""Move of a store: from a data directory into PostgreSQL and a bucket, and back.

Nothing is removed where it came from. Files go first and rows in one transaction at the end, so a
move that was interrupted is begun again.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import Connection, Table, func, insert, select

from service.backup.manifest import BackupError
from service.database.engine import Database
from service.database.store import check_store, open_store
from service.database.tables import api_keys, clouds, jobs, metadata, uploads, worker_slots
from service.jobs.retention import find_needed_blobs
from service.jobs.worker_slots import WorkerSlots
from service.settings import BlobSettings, Settings
from service.storage.blobs import BlobStore
from service.storage.file_lock import is_unlocked
from service.storage.open_blobs import open_blobs
from service.storage.store_mark import StoreMark

ROWS_AT_ONCE = 1000
CHUNK_BYTES = 1 << 20
TABLES = [table for table in metadata.sorted_tables if table is not worker_slots]
"""What is moved: all but what tells of services that run; what others refer to comes first."""

OnProgress = Callable[[str, float], None]
"""Called with what is moved, and the share of it that is done, in [0, 1]."""


@dataclass(frozen=True, slots=True)
class Moved:
    """What a move has done."""

    rows: int
    files: int
    missing: list[str]
    """Hashes of files that rows name and the source did not have."""
    left_out: int
    """Unfinished uploads, which have to begin again."""


def directory_settings(cluster: Settings, directory: Path) -> Settings:
    """Return the settings of a service that has all in one directory."""
    values = {"data_dir": directory, "database_url": None, "blob": BlobSettings()}
    return cluster.model_copy(update=values)


def move_store(source: Settings, target: Settings, on_progress: OnProgress) -> Moved:
    """Copy all rows and files to an empty store; no service may run on either.

    Raises
    ------
    BackupError
        The target has rows, or a service runs.
    StoreLostError, NotReadyError
        The source is missing or damaged, or a store does not answer.
    """
    if source.database_url is None and not source.sqlite_path.exists():
        raise BackupError(f"{source.data_dir} has no job store; name its data directory")
    check_store(source)
    for place in (source, target):
        if place.database_url is None and not is_unlocked(place.data_dir / "lock"):
            raise BackupError(f"a service runs on {place.data_dir}: stop it")
    with _opened(source) as (rows, files), _opened(target) as (new_rows, new_files):
        for place, database in ((source, rows), (target, new_rows)):
            if place.database_url is not None and WorkerSlots(database, 0).count():
                raise BackupError("services run on the database: stop them; 30 s later try again")
        _check_empty(new_rows)
        missing = _copy_files(rows, files, new_files, on_progress)
        with rows.read() as old, new_rows.write(exclusive=True) as new:
            number = _copy_rows(old, new, on_progress)
            left_out = old.scalar(select(func.count()).where(~uploads.c.is_complete)) or 0
            has_keys = old.scalar(select(func.count()).select_from(api_keys)) or 0
    if has_keys and target.database_url is None:
        StoreMark(target.data_dir).record_keys()
    return Moved(number, len(missing[0]), missing[1], left_out)


@contextmanager
def _opened(settings: Settings) -> Iterator[tuple[Database, BlobStore]]:
    """Open rows and files; those of a cluster need no data directory but for a while."""
    with ExitStack() as stack:
        if settings.database_url is not None:
            scratch = stack.enter_context(tempfile.TemporaryDirectory(prefix="mpe-move-"))
            if settings.blob.url is not None:
                settings = settings.model_copy(update={"data_dir": Path(scratch)})
        database = stack.enter_context(closing(open_store(settings)))
        yield database, open_blobs(settings)


def _check_empty(database: Database) -> None:
    with database.read() as connection:
        for table in (jobs, clouds, api_keys):
            if connection.scalar(select(func.count()).select_from(table)):
                raise BackupError(
                    f"the target has {table.name}: name an empty database, or an empty directory"
                )


def _copy_files(
    database: Database, source: BlobStore, target: BlobStore, on_progress: OnProgress
) -> tuple[list[str], list[str]]:
    """Copy what the rows name; return the hashes of what was copied, and of what was missing."""
    copied: list[str] = []
    missing: list[str] = []
    names = sorted(find_needed_blobs(database))
    for number, sha256 in enumerate(names):
        on_progress("files", number / len(names))
        try:
            with source.hold(sha256) as path, path.open("rb") as file:
                chunks = iter(lambda: file.read(CHUNK_BYTES), b"")
                is_whole = target.put(chunks).sha256 == sha256
        except FileNotFoundError:
            is_whole = False
        (copied if is_whole else missing).append(sha256)
    on_progress("files", 1.0)
    return copied, missing


def _copy_rows(old: Connection, new: Connection, on_progress: OnProgress) -> int:
    number = 0
    for place, table in enumerate(TABLES):
        on_progress("rows", place / len(TABLES))
        number += _copy_table(old, new, table)
    on_progress("rows", 1.0)
    return number


def _copy_table(old: Connection, new: Connection, table: Table) -> int:
    query = select(table)
    if table is uploads:
        query = query.where(uploads.c.is_complete)
    number = 0
    for part in old.execute(query).partitions(ROWS_AT_ONCE):
        new.execute(insert(table), [dict(row._mapping) for row in part])
        number += len(part)
    return number
