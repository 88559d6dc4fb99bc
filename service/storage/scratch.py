"""Folders for the unfinished work of attempts; each is gone when its attempt is."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path


def scratch_of(data_dir: Path, job_id: str, attempt: int) -> Path:
    """The folder of an attempt; made after the job was claimed."""
    return data_dir / "scratch" / f"{job_id}-{attempt}"


def discard_scratch(data_dir: Path, running: Callable[[], set[tuple[str, int]]]) -> None:
    """Remove what attempts left that do not run any more: who ran them was killed.

    What runs is asked after the folders have been listed: another process may begin meanwhile.
    """
    found = list((data_dir / "scratch").glob("*"))
    kept = {f"{job_id}-{attempt}" for job_id, attempt in running()} if found else set()
    for folder in found:
        if folder.name not in kept:
            shutil.rmtree(folder, ignore_errors=True)
