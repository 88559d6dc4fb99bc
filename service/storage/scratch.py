"""Folders for unfinished work, removed with the work that they belong to."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from service.storage.file_lock import exclusive_lock, is_unlocked

LOCK_NAME = ".lock"


@contextmanager
def scratch_folder(data_dir: Path, name: str) -> Iterator[Path]:
    """Make a folder that is locked while the context lasts and removed when it ends.

    Parameters
    ----------
    data_dir : Path
        Data directory of the service.
    name : str
        Name of the folder; unique among those in use.

    Yields
    ------
    Path
        The folder, in the same file system as the blobs.

    Raises
    ------
    FileExistsError
        A folder of this name is in use.
    """
    folder = _root(data_dir) / name
    with ExitStack() as lock:
        with exclusive_lock(_registry_lock(data_dir)):
            folder.mkdir()
            lock.enter_context(exclusive_lock(folder / LOCK_NAME))
        try:
            yield folder
        finally:
            _remove(folder)


def count_bytes(folder: Path) -> int:
    """Return the length of all files in a folder and below it, whoever removes some meanwhile."""
    total = 0
    for place, names in _walk(folder):
        for name in names:
            with suppress(OSError):
                total += os.lstat(os.path.join(place, name)).st_size  # noqa: PTH118
    return total


def discard_scratch(data_dir: Path) -> None:
    """Remove the folders whose owner was killed: nobody holds their lock any more."""
    with exclusive_lock(_registry_lock(data_dir)):
        for folder in _root(data_dir).iterdir():
            if is_unlocked(folder / LOCK_NAME):
                _remove(folder)


def _remove(folder: Path) -> None:
    for _ in _walk(folder):
        pass
    shutil.rmtree(folder, ignore_errors=True)


def _walk(folder: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield each folder below and its files; those that were made without rights are opened."""
    for place, folders, files in os.walk(folder):
        for name in folders:
            path = Path(place, name)
            with suppress(OSError):
                if not path.is_symlink():
                    path.chmod(0o700)
        yield place, files


def _root(data_dir: Path) -> Path:
    root = data_dir / "scratch"
    root.mkdir(parents=True, exist_ok=True)
    return root


def _registry_lock(data_dir: Path) -> Path:
    """Return the file whose lock keeps the making of a folder and the clean-up apart."""
    return _root(data_dir).parent / "scratch.lock"
