"""Resource limits, priority and lifetime of a child process."""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
import sys
from dataclasses import dataclass

IDLE_NAME, BUSY_NAME = "mpe-idle", "mpe-busy"
"""Process names of a child without and with a task."""
MAX_OPEN_FILES = 256
"""Open files of a child; libraries and readers need some 50."""
MAX_FILE_BYTES = 64 * 2**30
"""Length of a file that a child writes, in bytes; the disk is watched elsewhere."""
AUTOGROUP = "/proc/self/autogroup"
OOM_SCORE_ADJ = "/proc/self/oom_score_adj"
OOM_SCORE = 500
"""What a child adds to its score of 0 to 1000 by which the kernel chooses whom to end for want of
memory: the job, and not the service."""
_PR_SET_PDEATHSIG = 1
_PR_SET_DUMPABLE = 4
_PR_SET_NAME = 15

_forkserver_pid: int | None = None


@dataclass(frozen=True, slots=True)
class ResourceLimits:
    """What a child process may take from the system."""

    memory_bytes: int
    """Address space in bytes."""
    cpu_s: int
    """CPU seconds of all threads together; the parent watches the wall clock."""


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
    """Have this process killed when the process `parent`, which started it, ends (Linux)."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def name_process(name: str) -> None:
    """Show this process under the name in process lists (Linux)."""
    _prctl(_PR_SET_NAME, name.encode())


def forbid_inspection() -> None:
    """Forbid other processes of the same user to read or trace this one (Linux).

    Forked processes inherit it; a program that is executed loses it.
    """
    _prctl(_PR_SET_DUMPABLE, 0)


def close_inherited(kept: int) -> None:
    """Close all descriptors but the standard ones and `kept`."""
    os.closerange(3, kept)
    os.closerange(kept + 1, os.sysconf("SC_OPEN_MAX"))


def _prctl(option: int, value: int | bytes) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value)


def lower_priority(niceness: int) -> None:
    """Run at lower CPU priority, so that the API answers first; call in a session of its own.

    Outside control groups Linux schedules by session (autogroup), and niceness ranks only within
    one: the session's autogroup is reniced as well. The kernel limits how often unprivileged users
    may do that (ten times a second, together); a refusal is ignored.
    """
    total = os.nice(niceness)
    _prctl(_PR_SET_DUMPABLE, 1)  # else the file belongs to root; see forbid_inspection
    with contextlib.suppress(OSError), open(AUTOGROUP, "w") as autogroup:  # noqa: PTH123
        autogroup.write(str(total))


def raise_oom_score(score: int = OOM_SCORE) -> None:
    """Have the kernel end this process before others when memory is short (Linux)."""
    _prctl(_PR_SET_DUMPABLE, 1)  # else the file belongs to root; see forbid_inspection
    with contextlib.suppress(OSError), open(OOM_SCORE_ADJ, "w") as file:  # noqa: PTH123
        file.write(str(score))


def apply_limits(limits: ResourceLimits) -> None:
    """Bound this process irrevocably, in a session and process group of its own."""
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
