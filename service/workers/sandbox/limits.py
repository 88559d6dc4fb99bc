"""What a worker process may take from the system, and that it never outlives its parent."""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
import sys
from dataclasses import dataclass

PR_SET_PDEATHSIG = 1
PR_SET_NAME = 15
IDLE_NAME, BUSY_NAME = "mpe-idle", "mpe-busy"
"""What workers are called in lists of processes."""
MAX_OPEN_FILES = 256
MAX_FILE_BYTES = 64 * 2**30
AUTOGROUP = "/proc/self/autogroup"

_forkserver_pid: int | None = None


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds on one attempt."""

    memory_bytes: int
    """Address space in bytes."""
    cpu_s: int
    """Processor seconds, all threads together; the wall clock is watched from outside."""


def remember_forkserver() -> None:
    """Record that this process is the forkserver; the children that it forks inherit the record."""
    global _forkserver_pid
    _forkserver_pid = os.getpid()


def forkserver_pid() -> int:
    """Return the process id of the forkserver that this process was forked from.

    Raises
    ------
    RuntimeError
        This process was not forked from a forkserver.
    """
    if _forkserver_pid is None:
        raise RuntimeError("this process was not forked from the forkserver")
    return _forkserver_pid


def die_with_parent(parent: int) -> None:
    """Be killed when the process `parent`, which started this one, ends (Linux)."""
    _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def name_process(name: str) -> None:
    """Show this process under the name (Linux)."""
    _prctl(PR_SET_NAME, name.encode())


def _prctl(option: int, value: int | bytes) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value)


def lower_priority(by: int) -> None:
    """Let the processor serve others first; in a session of its own, which is set back as a whole.

    Where processes are in no control group Linux shares the processor among sessions first, and by
    niceness within each: that of a process alone would say nothing to the service. Without
    privileges it can be set ten times a second, by all together; it is not worth waiting for.
    """
    niceness = os.nice(by)
    with contextlib.suppress(OSError), open(AUTOGROUP, "w") as session:  # noqa: PTH123
        session.write(str(niceness))


def apply_limits(limits: Limits) -> None:
    """Bound this process, for good."""
    os.setsid()
    bounds = {
        resource.RLIMIT_AS: limits.memory_bytes,
        resource.RLIMIT_CPU: limits.cpu_s,
        resource.RLIMIT_FSIZE: MAX_FILE_BYTES,
        resource.RLIMIT_NOFILE: MAX_OPEN_FILES,
        resource.RLIMIT_CORE: 0,
    }
    for kind, value in bounds.items():
        _, hard = resource.getrlimit(kind)
        bound = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(kind, (bound, bound))
