"""A child process of the warm forkserver, as the service process sees it."""

from __future__ import annotations

import contextlib
import importlib.machinery
import logging
import multiprocessing
import os
import signal
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import forkserver
from multiprocessing.connection import Connection, wait

from service.workers.child_main import child_main
from service.workers.messages import Message, MessageError, Ready
from service.workers.pipe import MessageReader
from service.workers.task import Task

START_TIMEOUT_S = 300.0
"""Seconds until a child must be ready; before the first, the forkserver may compile the kernels."""
ANSWER_TIMEOUT_S = 5.0
"""Seconds that a forkserver which has forked before may take to fork; then it is replaced."""
WATCH_INTERVAL_S = 0.25
"""Interval of the looks at a start, in seconds; more time between two looks does not count."""
START_TRIES = 3
"""How often the start of a process is tried, in case the forkserver has just been killed."""
START_PAUSE_S = 0.05
"""Seconds between the tries, in which the system removes the killed forkserver."""
FORKSERVER_GONE = 255
"""Exit code that multiprocessing reports when the forkserver ended before the child."""
BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

log = logging.getLogger(__name__)
_context = multiprocessing.get_context("forkserver")
# Linux ends a process with the very thread that started it: a worker thread that ends, while others
# go on, would take the forkserver and all its children along. multiprocessing polls and closes
# processes of all threads in start(): this thread alone calls it. Nobody waits for it without limit
_forkservers_that_answered: set[int | None] = set()
_is_stopped = threading.Event()
_starter = ThreadPoolExecutor(max_workers=1, thread_name_prefix="starter")


OUT_OF_MEMORY = (
    "The machine or its container ran out of memory, and the kernel ended the process: send"
    " smaller clouds, or give the service more memory or fewer workers (MPE_WORKERS)."
)
_LOADER_ABORT = 127
"""Exit code of a process whose C library got no memory for a thread; no child executes a program,
which is the other reason for this code."""
_KILLED = f"its process was ended by {signal.SIGKILL.name}"


class ChildLostError(Exception):
    """The child ended or sent nonsense before it gave its answer; the text says which."""

    @property
    def is_killed(self) -> bool:
        """Whether the process was killed, as the kernel does where memory is short."""
        return str(self) == _KILLED


class ChildMemoryError(ChildLostError):
    """The child ended because it was allowed no more memory."""


class NoProcessError(ChildLostError):
    """The child could not be started, or ended with the forkserver; no fault of its task."""


def prepare_forkserver(threads: int) -> None:
    """Configure the forkserver that the first child starts.

    Children must not run the `__main__` of the service again, as multiprocessing would have them
    do; it skips modules whose name ends in `.__main__`.

    Parameters
    ----------
    threads : int
        Threads of the numerical libraries of a child.
    """
    _is_stopped.clear()
    for name in BLAS_THREADS:
        os.environ.setdefault(name, str(threads))
    os.environ["NUMBA_THREADING_LAYER"] = "workqueue"  # the layer that survives a fork
    _context.set_forkserver_preload(
        ["service.workers.sandbox.environment", "service.workers.forkserver"]
    )
    sys.modules["__main__"].__spec__ = importlib.machinery.ModuleSpec("service.__main__", None)


class Child:
    """A child process for one task: `send_task`, `receive` its messages, `kill`, `close`.

    The process starts in the background; `wait_until_ready` waits for it.
    """

    def __init__(self) -> None:
        ours, theirs = multiprocessing.Pipe()
        self._connection: Connection = ours
        self._reader = MessageReader(ours)
        self._process = _context.Process(target=child_main, args=(theirs,))
        self._lock = threading.Lock()
        self._is_killed = False
        self._is_closed = False
        self._is_ready = False
        self._silent_s = 0.0
        self._give_up_at = time.monotonic() + START_TIMEOUT_S
        self._start = _starter.submit(self._start_process, theirs)

    def wait_until_ready(self, timeout_s: float = START_TIMEOUT_S) -> bool:
        """Wait for the child's first message; return False when it has not come yet.

        Raises
        ------
        NoProcessError
            The child could not be started, or is not ready after START_TIMEOUT_S.
        """
        deadline = time.monotonic() + timeout_s
        if not self._is_ready and self._watch_start(deadline):
            try:
                message = self.receive(max(0.0, deadline - time.monotonic()))
            except ChildLostError as error:
                raise NoProcessError(f"a process ended before it was ready: {error}") from error
            self._is_ready = isinstance(message, Ready)
        if not self._is_ready and time.monotonic() >= self._give_up_at:
            raise NoProcessError(f"a process was not ready after {START_TIMEOUT_S:g} s")
        if self._is_ready and not self.is_alive:
            raise NoProcessError("a process ended while it waited for a task")
        return self._is_ready

    def _watch_start(self, deadline: float) -> bool:
        """Wait for the start; return False when it is not over at the deadline.

        A forkserver that has answered before, and does not for ANSWER_TIMEOUT_S, is killed: the
        start makes a new one. One that is new may compile for minutes.

        Parameters
        ----------
        deadline
            By `time.monotonic`.

        Raises
        ------
        NoProcessError
            The process could not be started.
        """
        while True:
            remaining_s = deadline - time.monotonic()
            try:
                self._start.result(max(0.0, min(remaining_s, WATCH_INTERVAL_S)))
                return True
            except TimeoutError:
                if remaining_s <= 0:
                    return False
            pid = _forkserver_pid()
            self._silent_s += WATCH_INTERVAL_S
            if pid not in _forkservers_that_answered:
                self._silent_s = 0.0
            elif self._silent_s >= ANSWER_TIMEOUT_S:
                _replace_forkserver(pid)

    @property
    def is_alive(self) -> bool:
        """Whether the process starts, or has not ended."""
        if not self._start.done():
            return True
        return self._has_started and not wait([self._process.sentinel], timeout=0)

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
            raise self._lost() from error

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
            raise self._lost() from error

    def kill(self) -> None:
        """End the child and its process group at once; one that still starts ends when it has."""
        with self._lock:
            self._is_killed = True
            if not self._is_closed and self._process.pid is not None:
                self._signal()

    def close(self) -> None:
        """Wait until the child has ended, killing it after a second, and free what it used."""
        self._start.cancel()
        if self._has_started and not wait([self._process.sentinel], timeout=1.0):
            self.kill()
            wait([self._process.sentinel], timeout=ANSWER_TIMEOUT_S)
        with self._lock:
            self._is_killed = True
            self._is_closed = True
        if not self._start.cancelled():
            _starter.submit(self._free_process)
        self._connection.close()

    @property
    def _has_started(self) -> bool:
        is_over = self._start.done() and not self._start.cancelled()
        return is_over and self._start.exception() is None

    def _start_process(self, theirs: Connection) -> None:
        """Start the process; multiprocessing replaces a killed forkserver at the next try."""
        with theirs:
            for tries_left in reversed(range(START_TRIES)):
                try:
                    self._process.start()
                    break
                except (OSError, EOFError) as error:
                    if not tries_left or _is_stopped.is_set():
                        said = getattr(error, "strerror", None) or type(error).__name__
                        reason = f"a process could not be started: {said}"
                        raise NoProcessError(reason) from error
                    time.sleep(START_PAUSE_S)
        _forkservers_that_answered.add(_forkserver_pid())
        with self._lock:
            if self._is_killed:
                self._signal()

    def _free_process(self) -> None:
        """Free what multiprocessing keeps of an ended process; keep it while it does not end."""
        if self._has_started and wait([self._process.sentinel], timeout=START_PAUSE_S):
            self._process.join()
            self._process.close()

    def _signal(self) -> None:
        """Send SIGKILL to the process and its group, unless it has ended."""
        assert self._process.pid is not None  # noqa: S101
        if wait([self._process.sentinel], timeout=0):
            return
        for send in (os.killpg, os.kill):
            with contextlib.suppress(ProcessLookupError, PermissionError):
                send(self._process.pid, signal.SIGKILL)

    def _lost(self) -> ChildLostError:
        """Return the error that says how the process ended."""
        if not wait([self._process.sentinel], timeout=1.0):
            return ChildLostError("its process closed the connection")
        try:
            code = _starter.submit(lambda: self._process.exitcode).result(1.0)
        except TimeoutError:  # the starter waits for a forkserver
            code = FORKSERVER_GONE
        if code is None:
            return ChildLostError("its process closed the connection")
        if code == FORKSERVER_GONE:
            return NoProcessError("the process that it was forked from was ended, and it with that")
        if code < 0:
            return ChildLostError(f"its process was ended by {signal.Signals(-code).name}")
        reason = f"its process ended with code {code}"
        return ChildMemoryError(reason) if code == _LOADER_ABORT else ChildLostError(reason)


def stop_forkserver() -> None:
    """End the forkserver; a start that waits for it fails."""
    _is_stopped.set()
    pid = _forkserver_pid()
    if pid is not None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def _forkserver_pid() -> int | None:
    """Return the id of the forkserver, which multiprocessing does not tell."""
    pid: int | None = getattr(forkserver._forkserver, "_forkserver_pid", None)
    return pid


def _replace_forkserver(pid: int | None) -> None:
    _forkservers_that_answered.discard(pid)
    if pid is not None and pid == _forkserver_pid():
        log.error("the forkserver did not answer for %g s and is replaced", ANSWER_TIMEOUT_S)
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
