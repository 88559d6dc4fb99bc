"""Restoring of a backup into an empty data directory."""

from __future__ import annotations

from pathlib import Path

from service.backup.manifest import BackedUpFile, BackupError, Manifest, copy_file, sync_directory
from service.backup.postgres_programs import DUMP_NAME, restore_database
from service.backup.verify import find_faults_of_backup
from service.database.store import has_tables
from service.settings import Settings
from service.storage.open_blobs import open_blobs
from service.storage.store_mark import StoreMark

_PARTIAL = ".partial"


def restore_backup(settings: Settings, source: Path) -> Manifest:
    """Copy a whole backup into the data directory, which must be empty.

    The store comes last: a service that is started before refuses to run.

    Raises
    ------
    BackupError
        The backup is not whole, the directory or the database is not empty, or the rows belong
        into another kind of database.
    NotReadyError
        The database does not answer.
    """
    data_dir = settings.data_dir
    manifest = Manifest.read(source)
    _check_place(settings, manifest)
    tolerated = len(manifest.missing)
    faults = list(find_faults_of_backup(source))
    if len(faults) > tolerated:
        raise BackupError(f"{source} is not whole: {'; '.join(faults[:9])}")
    data_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
    StoreMark(data_dir).make()
    blobs = open_blobs(settings)
    stores = (settings.sqlite_path.name, DUMP_NAME)
    for file in sorted(manifest.files, key=lambda file: file.path in stores):
        if file.path == DUMP_NAME:
            restore_database(settings.store_url, source / DUMP_NAME)
        else:
            _restore_file(source, data_dir, file)
        if file.path.startswith("blobs/"):
            blobs.touch(file.sha256)
    return manifest


def _check_place(settings: Settings, manifest: Manifest) -> None:
    is_dump = any(file.path == DUMP_NAME for file in manifest.files)
    if is_dump and settings.database_url is None:
        raise BackupError(
            "the rows of the backup were in PostgreSQL: set MPE_DATABASE_URL to an empty database"
        )
    if not is_dump and settings.database_url is not None:
        raise BackupError("MPE_DATABASE_URL is set, but the backup is of a store without it")
    if settings.data_dir.exists() and any(settings.data_dir.iterdir()):
        raise BackupError(
            f"{settings.data_dir} is not empty; set MPE_DATA_DIR to an empty directory"
        )
    if is_dump and has_tables(settings):
        raise BackupError("the database has a job store; set MPE_DATABASE_URL to an empty database")


def _restore_file(source: Path, data_dir: Path, file: BackedUpFile) -> None:
    target = data_dir / file.path
    partial = target.with_name(target.name + _PARTIAL)
    if copy_file(source / file.path, partial, file.path) != file:
        raise BackupError(f"{source / file.path} changed while it was copied")
    partial.replace(target)
    sync_directory(target.parent)
