"""Restoring of a backup into an empty data directory."""

from __future__ import annotations

from pathlib import Path

from service.backup.manifest import BackupError, Manifest, copy_file, sync_directory
from service.backup.verify import find_faults_of_backup
from service.settings import Settings
from service.storage.store_mark import StoreMark

_PARTIAL = ".partial"


def restore_backup(settings: Settings, source: Path) -> Manifest:
    """Copy a whole backup into the data directory, which must be empty.

    The store comes last: a service that is started before refuses to run.

    Raises
    ------
    BackupError
        The backup is not whole, the directory is not empty, or the rows belong in PostgreSQL.
    """
    data_dir = settings.data_dir
    if settings.database_url is not None:
        raise BackupError("MPE_DATABASE_URL is set, but the backup is of a store without it")
    if data_dir.exists() and any(data_dir.iterdir()):
        raise BackupError(f"{data_dir} is not empty; set MPE_DATA_DIR to an empty directory")
    manifest = Manifest.read(source)
    tolerated = len(manifest.missing)
    faults = list(find_faults_of_backup(source))
    if len(faults) > tolerated:
        raise BackupError(f"{source} is not whole: {'; '.join(faults[:9])}")
    data_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
    StoreMark(data_dir).make()
    store = settings.sqlite_path.name
    for file in sorted(manifest.files, key=lambda file: file.path == store):
        target = data_dir / file.path
        partial = target.with_name(target.name + _PARTIAL)
        if copy_file(source / file.path, partial, file.path) != file:
            raise BackupError(f"{source / file.path} changed while it was copied")
        partial.replace(target)
        sync_directory(target.parent)
    return manifest
