"""Verification of a backup, and of a data directory, by the hashes of all files."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from service.backup.manifest import Manifest, hash_file
from service.database.store import HEALTHY, check_store, open_store
from service.jobs.retention import find_needed_blobs
from service.settings import Settings
from service.storage.blobs import blob_path
from service.storage.open_blobs import open_blobs


def find_faults_of_backup(directory: Path) -> Iterator[str]:
    """Yield what is wrong with a backup, one line each.

    Raises
    ------
    BackupError
        It has no manifest.
    """
    manifest = Manifest.read(directory)
    for file in manifest.files:
        path = directory / file.path
        if not path.is_file():
            yield f"{file.path} is missing"
        elif path.stat().st_size != file.size or hash_file(path) != file.sha256:
            yield f"{file.path} is damaged"
        elif path.suffix == ".sqlite3":
            yield from _find_faults_of_store(path)
    yield from (f"{name} was missing when the backup was made" for name in manifest.missing)


def find_faults_of_data(settings: Settings) -> Iterator[str]:
    """Yield what is wrong with the files of a data directory; the service may run.

    Raises
    ------
    StoreLostError, NotReadyError, RuntimeError
        The store is missing, damaged or of a later release, or does not answer.
    """
    check_store(settings)
    blobs = open_blobs(settings)
    with closing(open_store(settings)) as database:
        faults = {}
        for sha256 in sorted(find_needed_blobs(database)):
            try:
                if not blobs.is_whole(sha256):
                    faults[sha256] = "is damaged"
            except FileNotFoundError:
                faults[sha256] = "is missing"
        still_needed = find_needed_blobs(database) if faults else set()
    for sha256, fault in faults.items():
        if sha256 in still_needed:  # else its row has been removed meanwhile, and it with that
            yield f"{os.fspath(blob_path(Path(), sha256))} {fault}"


def _find_faults_of_store(path: Path) -> Iterator[str]:
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as store:
            (found,) = store.execute("PRAGMA quick_check(1)").fetchone()
    except sqlite3.DatabaseError as error:
        found = str(error)
    if found != HEALTHY:
        yield f"{path.name} is damaged: {found}"
