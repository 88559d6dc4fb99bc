"""The processes of a running server."""

from __future__ import annotations

from pathlib import Path

import psutil

from service.jobs.confinement import BUSY_NAME
from tests.server import Server


def forkserver(server: Server) -> psutil.Process:
    children = psutil.Process(server.pid).children()
    return next(child for child in children if "forkserver" in " ".join(child.cmdline()))


def workers(server: Server) -> list[psutil.Process]:
    """The processes that perform a job; those that wait for one are left out."""
    children = forkserver(server).children(recursive=True)
    return [child for child in children if _name(child) == BUSY_NAME]


def _name(process: psutil.Process) -> str:
    try:
        return process.name()
    except psutil.NoSuchProcess:
        return ""


def all_of(data_dir: Path) -> list[psutil.Process]:
    """Every process that was started for the data directory, orphans too."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get("MPE_DATA_DIR") == str(data_dir):
                found.append(process)
        except psutil.Error:
            continue
    return found
