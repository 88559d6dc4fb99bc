"""A child process of the warm forkserver, as the service process sees it."""

from __future__ import annotations

import contextlib
import importlib.machinery
import multiprocessing
import os
import signal
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection, wait
from typing import Any

from service.workers.child_main import child_main
from service.workers.messages import Message, MessageError, Ready
from service.workers.pipe import MessageReader
from service.workers.task import Task

START_TIMEOUT_S = 120.0
"""Seconds until a child must be ready; before the first, the forkserver may compile the kernels."""
START_TRIES = 3
"""How often the start of a process is tried, in case the forkserver has just been killed."""
START_PAUSE_S = 0.05
"""Seconds between the tries, in which the system removes the killed forkserver."""
FORKSERVER_GONE = 255
"""Exit code that multiprocessing reports when the forkserver ended before the child."""
BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

_context = multiprocessing.get_context("forkserver")
# multiprocessing polls and closes processes of all threads in start(): one thread at a time
_processes = threading.Lock()
# Linux ends a process with the very thread that started it: a worker thread that ends, while others
# go on, would take the forkserver and all its children along
_starter = ThreadPoolExecutor(max_workers=1, thread_name_prefix="starter")


class ChildLostError(Exception):
    """The child ended or sent nonsense before it gave its answer; the text says which."""


def prepare_forkserver(threads: int) -> None:
    """Configure the forkserver that the first child starts.

    Children must not run the `__main__` of the service again, as multiprocessing would have them
    do; it skips modules whose name ends in `.__main__`.

    Parameters
    ----------
    threads : int
        Threads of the numerical libraries of a child.
    """
    for name in BLAS_THREADS:
        os.environ.setdefault(name, str(threads))
    os.environ["NUMBA_THREADING_LAYER"] = "workqueue"  # the layer that survives a fork
    _context.set_forkserver_preload(["service.workers.forkserver"])
    sys.modules["__main__"].__spec__ = importlib.machinery.ModuleSpec("service.__main__", None)


class Child:
    """A child process for one task: `send_task`, `receive` its messages, `kill`, `close`.

    Raises
    ------
    ChildLostError
        The process could not be started.
    """

    def __init__(self) -> None:
        ours, theirs = multiprocessing.Pipe()
        self._connection: Connection = ours
        self._reader = MessageReader(ours)
        self._process = _context.Process(target=child_main, args=(theirs,))
        self._is_closed = False
        self._is_ready = False
        with theirs, _processes:
            _starter.submit(_start, self._process).result()

    def wait_until_ready(self, timeout_s: float = START_TIMEOUT_S) -> bool:
        """Wait for the child's first message; return False when it does not come or it died."""
        if not self._is_ready:
            with contextlib.suppress(ChildLostError):
                self._is_ready = isinstance(self.receive(timeout_s), Ready)
        return self._is_ready and self.is_alive

    @property
    def is_alive(self) -> bool:
        """Whether the process has not ended."""
        return not wait([self._process.sentinel], timeout=0)

    def send_task(self, task: Task) -> None:
        """Hand over the task.

        Raises
        ------
        ChildLostError
            The child has ended.
        """
        try:
            self._connection.send(task)
        except OSError as error:
            raise ChildLostError(self._exit_reason()) from error

    def receive(self, timeout_s: float) -> Message | None:
        """Return the next message, or None after the timeout.

        Raises
        ------
        ChildLostError
            The child ended, or what it sent is no valid message.
        """
        try:
            return self._reader.receive(timeout_s)
        except MessageError as error:
            raise ChildLostError(str(error)) from error
        except EOFError as error:
            raise ChildLostError(self._exit_reason()) from error

    def kill(self) -> None:
        """End the child and its process group at once."""
        with _processes:
            if not self._is_closed and self._process.is_alive():
                assert self._process.pid is not None  # noqa: S101
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.killpg(self._process.pid, signal.SIGKILL)
                self._process.kill()

    def close(self) -> None:
        """Wait until the child has ended, killing it after a second, and free what it used."""
        if not wait([self._process.sentinel], timeout=1.0):
            self.kill()
            wait([self._process.sentinel])
        with _processes:
            self._process.join()
            self._process.close()
            self._is_closed = True
        self._connection.close()

    def _exit_reason(self) -> str:
        wait([self._process.sentinel], timeout=1.0)
        with _processes:
            code = self._process.exitcode
        if code is None:
            return "its process closed the connection"
        if code == FORKSERVER_GONE:
            return "the process that it was forked from was ended, and it with that"
        if code < 0:
            return f"its process was ended by {signal.Signals(-code).name}"
        return f"its process ended with code {code}"


def _start(process: Any) -> None:
    """Start the process; multiprocessing replaces a killed forkserver at the next try."""
    for tries_left in reversed(range(START_TRIES)):
        try:
            process.start()
            return
        except (OSError, EOFError) as error:
            if not tries_left:
                raise ChildLostError("its process could not be started") from error
            time.sleep(START_PAUSE_S)
