"""`mpe admin`: what is done to a store as a whole."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from service.cli.progress import show_progress
from service.settings import Settings


def add_admin(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    admin = commands.add_parser("admin", help="move a store to another place")
    tasks = admin.add_subparsers(dest="task", required=True, metavar="TASK")
    move = tasks.add_parser(
        "move-store",
        help="copy a data directory into MPE_DATABASE_URL and MPE_BLOB_URL, or back; no service "
        "may run, and nothing is removed where it came from",
    )
    move.add_argument("directory", type=Path, help="the data directory, or an empty one to fill")
    move.add_argument(
        "--to",
        choices=("cluster", "directory"),
        required=True,
        help="cluster: PostgreSQL, and the bucket if MPE_BLOB_URL names one",
    )


def run_admin(arguments: argparse.Namespace, settings: Settings) -> bool:
    """Move a store; return whether it had every file that it names.

    Raises
    ------
    RuntimeError, OSError, NotReadyError
        It cannot be moved.
    """
    from service.backup.move import directory_settings, move_store

    settings.check_shared()
    stores = [directory_settings(settings, arguments.directory), settings]
    source, target = stores if arguments.to == "cluster" else stores[::-1]
    with show_progress() as on_progress:
        moved = move_store(source, target, on_progress)
    print(f"{moved.rows} rows and {moved.files} files were copied")
    if moved.left_out:
        print(f"{moved.left_out} unfinished uploads were left out; they begin again")
    for sha256 in moved.missing:
        print(f"mpe: the file {sha256} is missing or damaged", file=sys.stderr)
    return not moved.missing
