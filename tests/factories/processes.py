"""The processes of a running server."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from service.workers.sandbox.limits import BUSY_NAME
from tests.factories.server import Server
from tests.factories.waiting import until


def forkserver(server: Server) -> psutil.Process:
    """It is replaced when it ends: waits for the next one."""
    (found,) = until(lambda: _forkservers(server))
    return found


def _forkservers(server: Server) -> list[psutil.Process]:
    children = psutil.Process(server.pid).children()
    return [child for child in children if "forkserver" in _command(child)]


@contextmanager
def suspended(server: Server) -> Iterator[None]:
    """Stop the server and all below it, as a machine that is suspended; they go on afterwards."""
    parent = psutil.Process(server.pid)
    stopped = [parent]
    parent.suspend()
    stopped += parent.children(recursive=True)  # a stopped server starts no more
    for process in stopped[1:]:
        with suppress(psutil.NoSuchProcess):
            process.suspend()
    try:
        yield
    finally:
        for process in reversed(stopped):
            with suppress(psutil.NoSuchProcess):
                process.resume()


def workers(server: Server) -> list[psutil.Process]:
    """The processes that perform a job; those that wait for one are left out."""
    try:
        children = forkserver(server).children(recursive=True)
    except psutil.NoSuchProcess:
        return []
    return [child for child in children if _name(child) == BUSY_NAME]


def _name(process: psutil.Process) -> str:
    try:
        return process.name()
    except psutil.NoSuchProcess:
        return ""


def _command(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())
    except psutil.Error:
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
