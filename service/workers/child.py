"""A child process from the warm forkserver, seen from the service process."""

from __future__ import annotations

import contextlib
import importlib.machinery
import json
import multiprocessing
import os
import signal
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection, wait
from typing import Any

from service.workers.entry import stand_by
from service.workers.task import FetchTask, Task

MAX_MESSAGE_BYTES = 1 << 20
START_TRIES = 3
START_PAUSE_S = 0.05
FORKSERVER_GONE = 255
"""What multiprocessing says in place of an exit code that the forkserver cannot tell any more."""
BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

_context = multiprocessing.get_context("forkserver")
# multiprocessing polls and closes processes of all threads in start(): one thread at a time
_processes = threading.Lock()
# Linux ends a process with the very thread that started it: a worker thread that ends, while others
# go on, would take the forkserver and all its children along
_starter = ThreadPoolExecutor(max_workers=1, thread_name_prefix="starter")


class ChildLostError(Exception):
    """The child ended, or stopped making sense, before it gave its answer."""


def prepare_forkserver(threads: int) -> None:
    """Say what the forkserver loads before its first fork, and how many threads its libraries take.

    Children must not run the service's own __main__ again, as multiprocessing would have them do;
    it leaves out modules whose name ends in `.__main__`.
    """
    for name in BLAS_THREADS:
        os.environ.setdefault(name, str(threads))
    os.environ["NUMBA_THREADING_LAYER"] = "workqueue"  # the layer that survives a fork
    _context.set_forkserver_preload(["service.workers.forkserver"])
    sys.modules["__main__"].__spec__ = importlib.machinery.ModuleSpec("service.__main__", None)


class Child:
    """One child process that waits for its one task.

    `hand` it the task, `receive` its messages, `kill` it with all that it started, `close` it.
    """

    def __init__(self) -> None:
        ours, theirs = multiprocessing.Pipe()
        self._connection: Connection = ours
        self._process = _context.Process(target=stand_by, args=(theirs,))
        self._closed = False
        self._has_spoken = False
        with theirs, _processes:
            _starter.submit(_start, self._process).result()

    def is_ready(self, timeout_s: float) -> bool:
        """Whether the child has said within the time that it is there; False when it died."""
        if not self._has_spoken:
            try:
                self._has_spoken = self.receive(timeout_s) is not None
            except ChildLostError:
                return False
        return self._has_spoken and self.is_alive

    @property
    def is_alive(self) -> bool:
        """Whether the process has not ended."""
        return not wait([self._process.sentinel], timeout=0)

    def hand(self, task: FetchTask | Task) -> None:
        """Give the child its task; ChildLostError when it is gone."""
        try:
            self._connection.send(task)
        except OSError as error:
            raise ChildLostError(self._epitaph()) from error

    def receive(self, timeout_s: float) -> dict[str, Any] | None:
        """The next message, or None after the timeout; ChildLostError when none can come."""
        if not self._connection.poll(max(0.0, timeout_s)):
            return None
        try:
            message = json.loads(self._connection.recv_bytes(MAX_MESSAGE_BYTES))
        except (EOFError, OSError, ValueError) as error:
            raise ChildLostError(self._epitaph()) from error
        if not isinstance(message, dict):
            raise ChildLostError("it sent something that is no message")
        return message

    def kill(self) -> None:
        """End the child and its process group at once."""
        with _processes:
            if not self._closed and self._process.is_alive():
                assert self._process.pid is not None  # noqa: S101
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.killpg(self._process.pid, signal.SIGKILL)
                self._process.kill()

    def close(self) -> None:
        """Wait until the child is gone, killing it if it lingers, and give back what it used."""
        if not wait([self._process.sentinel], timeout=1.0):
            self.kill()
            wait([self._process.sentinel])
        with _processes:
            self._process.join()
            self._process.close()
            self._closed = True
        self._connection.close()

    def _epitaph(self) -> str:
        wait([self._process.sentinel], timeout=1.0)
        with _processes:
            code = self._process.exitcode
        if code == FORKSERVER_GONE:
            return "the process that it was forked from was ended, and it with that"
        if code is not None and code < 0:
            return f"its process was ended by {signal.Signals(-code).name}"
        return f"its process ended with code {code}"


def _start(process: Any) -> None:
    """Start the process; a forkserver that has just been killed is replaced at the next try."""
    for last_try in (False,) * (START_TRIES - 1) + (True,):
        try:
            process.start()
            return
        except (OSError, EOFError) as error:
            if last_try:
                raise ChildLostError("its process could not be started") from error
            time.sleep(START_PAUSE_S)  # the system takes a moment to bury the forkserver
