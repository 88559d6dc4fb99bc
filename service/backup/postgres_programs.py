"""PostgreSQL's own programs, which copy and restore a database."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from sqlalchemy import make_url

from service.backup.manifest import BackupError

DUMP_NAME = "jobs.pgdump"
"""File of a backup with the rows, in the custom format of pg_dump."""
_AS_ANYBODY = ("--no-owner", "--no-privileges")
"""The database may belong to another role where it is restored."""


def dump_database(url: str, target: Path, *, snapshot: str) -> None:
    """Write all rows, as an exported snapshot shows them, and read the file back.

    Raises
    ------
    BackupError
        pg_dump is missing or fails.
    """
    options = ("--format=custom", f"--snapshot={snapshot}", f"--file={target}", *_AS_ANYBODY)
    _run("pg_dump", url, *options)
    _run("pg_restore", None, f"--file={os.devnull}", str(target))


def restore_database(url: str, dump: Path) -> None:
    """Restore all rows or none into a database without tables.

    Raises
    ------
    BackupError
        pg_restore is missing or fails.
    """
    _run("pg_restore", url, "--single-transaction", "--exit-on-error", *_AS_ANYBODY, str(dump))


def _run(program: str, url: str | None, *arguments: str) -> None:
    environment = dict(os.environ)
    if url is not None:
        parsed = make_url(url).set(drivername="postgresql")
        if parsed.password is not None:  # every user of the machine can read arguments
            environment["PGPASSWORD"] = str(parsed.password)
        plain = parsed._replace(password=None).render_as_string()
        arguments = (f"--dbname={plain}", *arguments)
    try:
        done = subprocess.run(  # noqa: S603 - no shell, the program is named here
            [program, *arguments], env=environment, capture_output=True, text=True, check=False
        )
    except FileNotFoundError:
        raise BackupError(
            f"{program} is not installed: install PostgreSQL's client programs, of the server's "
            "version or a later one (Debian: postgresql-client)"
        ) from None
    if done.returncode:
        raise BackupError(f"{program} failed: {done.stderr.strip()[-1000:]}")
