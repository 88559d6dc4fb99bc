"""Making of a backup, while the service runs or not.

The store is copied first, in one transaction, then the files that this copy names. Files never
change under their name, and one that is needed no more stays for MPE_BLOB_GRACE_S: what the copy
names is there. Where it is not, store and files are copied again.
"""

from __future__ import annotations

import contextlib
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

from service.backup.manifest import (
    BackedUpFile,
    BackupError,
    Manifest,
    copy_file,
    sync_directory,
)
from service.backup.store_copy import copy_store
from service.database.store import check_store
from service.settings import Settings
from service.storage.blobs import BlobStore
from service.storage.open_blobs import open_blobs
from service.storage.store_mark import KEYS_MARK, STORE_MARK

TRIES = 3
"""Copies of the store that are made until one names files that are all there."""


def make_backup(settings: Settings, target: Path) -> Manifest:
    """Copy store and files into a new directory.

    Raises
    ------
    BackupError
        The directory exists, there is too little room, or PostgreSQL's programs fail.
    StoreLostError, NotReadyError
        The store is missing or damaged, or does not answer.
    """
    _check_possible(settings, target)
    check_store(settings)
    partial = target.with_name(f"{target.name}.partial")
    if partial.exists():
        raise BackupError(f"{partial} exists: another backup is being made, or was interrupted")
    partial.mkdir(mode=0o700, parents=True)
    try:
        manifest = _copy_all(settings, partial)
        manifest.write(partial)
        sync_directory(partial)
        partial.rename(target)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
    sync_directory(target.parent)
    return manifest


def _check_possible(settings: Settings, target: Path) -> None:
    if settings.database_url is None and not settings.sqlite_path.exists():
        raise BackupError(f"{settings.data_dir} has no job store; is MPE_DATA_DIR right?")
    if target.exists():
        raise BackupError(f"{target} exists; name a new directory")


def _copy_all(settings: Settings, partial: Path) -> Manifest:
    copied: dict[str, BackedUpFile] = {}
    blobs = open_blobs(settings)
    for _ in range(TRIES):
        store = copy_store(settings, partial)
        names = store.names
        _check_room(settings.data_dir, partial, [name for name in names if name not in copied])
        for name in names:
            with contextlib.suppress(FileNotFoundError), _hold(settings, blobs, name):
                _copy_once(settings.data_dir, partial, name, copied)
        missing = [name for name in names if name not in copied]
        if not missing:
            break
    marks = [mark for mark in (STORE_MARK, KEYS_MARK) if (settings.data_dir / mark).exists()]
    for mark in marks:
        _copy_once(settings.data_dir, partial, mark, copied)
    kept = [copied[name] for name in (*names, *marks) if name in copied]
    for name in set(copied) - set(names) - set(marks):  # needed by an earlier copy of the store
        (partial / name).unlink()
    return Manifest(
        release=version("mpe"), created_at=time.time(), files=[store.file, *kept], missing=missing
    )


def _copy_once(data_dir: Path, partial: Path, name: str, copied: dict[str, BackedUpFile]) -> None:
    """Copy a file unless it has been; leave out one that is missing or damaged."""
    if name in copied:
        return
    try:
        described = copy_file(data_dir / name, partial / name, name)
    except FileNotFoundError:
        return
    if name.startswith("blobs/") and described.sha256 != Path(name).name:
        (partial / name).unlink()
        return
    copied[name] = described


@contextmanager
def _hold(settings: Settings, blobs: BlobStore, name: str) -> Iterator[None]:
    """Keep a file in the data directory; a blob of a bucket is downloaded to it."""
    if settings.blob.url is None or not name.startswith("blobs/"):
        yield
        return
    with blobs.hold(Path(name).name):
        yield


def _check_room(data_dir: Path, partial: Path, names: list[str]) -> None:
    needed = sum(path.stat().st_size for name in names if (path := data_dir / name).exists())
    free = shutil.disk_usage(partial).free
    if needed > free:
        raise BackupError(f"the backup needs {needed} bytes, but {partial} has {free} free")
