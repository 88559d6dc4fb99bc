"""`mpe backup`, `mpe restore` and `mpe check`: copies of the data directory."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from service.settings import Settings

if TYPE_CHECKING:
    from service.backup.manifest import BackedUpFile


def add_backup(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the three commands."""
    backup = commands.add_parser(
        "backup", help="copy the data directory into a new one; the service may run"
    )
    backup.add_argument("directory", type=Path, help="directory to make")
    restore = commands.add_parser(
        "restore", help="copy a backup into an empty MPE_DATA_DIR; the service must not run"
    )
    restore.add_argument("directory", type=Path, help="directory that `mpe backup` made")
    check = commands.add_parser(
        "check", help="compare all files with their hashes; the service may run"
    )
    check.add_argument(
        "directory", type=Path, nargs="?", help="a backup; default: the data directory"
    )


def back_up(directory: Path, settings: Settings) -> bool:
    """Make a backup; return whether it has every file that the store names.

    Raises
    ------
    RuntimeError, OSError, NotReadyError
        It cannot be made.
    """
    from service.backup.make import make_backup

    manifest = make_backup(settings, directory)
    print(f"{directory}: {len(manifest.files)} files, {_total(manifest.files)} bytes")
    return _print_faults(f"{name} is missing or damaged" for name in manifest.missing)


def restore(directory: Path, settings: Settings) -> bool:
    """Restore a backup; return whether it has every file that its store names.

    Raises
    ------
    RuntimeError, OSError
        It cannot be restored.
    """
    from service.backup.restore import restore_backup

    manifest = restore_backup(settings, directory)
    print(f"{settings.data_dir}: {len(manifest.files)} files, {_total(manifest.files)} bytes")
    return _print_faults(f"{name} was missing in the backup" for name in manifest.missing)


def check(directory: Path | None, settings: Settings) -> bool:
    """Check a backup or the data directory; return whether it is whole.

    Raises
    ------
    RuntimeError, OSError, NotReadyError
        The store cannot be read.
    """
    from service.backup.verify import find_faults_of_backup, find_faults_of_data

    if directory is None:
        is_whole = _print_faults(find_faults_of_data(settings))
    else:
        is_whole = _print_faults(find_faults_of_backup(directory))
    if is_whole:
        print(f"{directory or settings.data_dir} is whole")
    return is_whole


def _print_faults(faults: Iterable[str]) -> bool:
    """Print the faults on stderr; return whether there are none."""
    is_whole = True
    for fault in faults:
        is_whole = False
        print(f"mpe: {fault}", file=sys.stderr)
    return is_whole


def _total(files: list[BackedUpFile]) -> int:
    return sum(file.size for file in files)
