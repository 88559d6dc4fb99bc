"""A Landlock ruleset that leaves a process the files of its task and nothing else (Linux 5.13).

It is written by hand, like the seccomp filter: three system calls without privileges. The numbers
are those of include/uapi/linux/landlock.h; what an older kernel does not know is left out.
"""

from __future__ import annotations

import ctypes
import os
import stat
import sys
from collections.abc import Iterable
from pathlib import Path

from service.workers.sandbox.seccomp import forbid_new_privileges

SCOPED_SIGNALS_ABI = 6
"""First version of Landlock that confines signals and abstract sockets (Linux 6.12)."""

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_QUERY_VERSION, _PATH_BENEATH = 1, 1

_WRITE_FILE, _READ_FILE, _READ_DIR = 1 << 1, 1 << 2, 1 << 3
_REMOVE_DIR, _REMOVE_FILE, _MAKE_DIR, _MAKE_REG = 1 << 4, 1 << 5, 1 << 7, 1 << 8
_TRUNCATE = 1 << 14
_READ = _READ_FILE | _READ_DIR
_WRITE = _READ | _WRITE_FILE | _TRUNCATE | _REMOVE_DIR | _REMOVE_FILE | _MAKE_DIR | _MAKE_REG
"""Of what can be created only files and folders: no links, pipes, sockets or devices."""
_FILE_RIGHTS = _READ_FILE | _WRITE_FILE | _TRUNCATE
_HANDLED_RIGHTS_BY_ABI = ((1, 13), (2, 14), (3, 15), (5, 16))
"""First version and the number of rights on files that it knows, counted from bit 0."""
_SCOPE_ABSTRACT_SOCKETS, _SCOPE_SIGNALS = 1, 2


class _RulesetAttr(ctypes.Structure):
    _fields_ = (
        ("handled_access_fs", ctypes.c_uint64),
        ("handled_access_net", ctypes.c_uint64),
        ("scoped", ctypes.c_uint64),
    )


class _PathBeneathAttr(ctypes.Structure):
    _pack_ = 1
    _fields_ = (("allowed_access", ctypes.c_uint64), ("parent_fd", ctypes.c_int32))


def landlock_abi() -> int:
    """Return the version of Landlock that the kernel has; 0 if it has none."""
    if sys.platform != "linux":
        return 0
    return max(0, _syscall(_CREATE_RULESET, None, 0, _QUERY_VERSION))


def restrict_files(readable: Iterable[Path], writable: Iterable[Path]) -> bool:
    """Leave this thread and those that it starts only these files, irrevocably.

    With Landlock 6 it also confines their signals to this process.

    Parameters
    ----------
    readable : iterable of Path
        Files, and folders with all that is below them; missing ones are left out.
    writable : iterable of Path
        Folders below which files can be read, made, changed and removed as well.

    Returns
    -------
    bool
        False where the kernel has no Landlock.

    Raises
    ------
    OSError
        The kernel has Landlock, but refuses the ruleset.
    """
    abi = landlock_abi()
    if abi == 0:
        return False
    handled = (1 << max(count for first, count in _HANDLED_RIGHTS_BY_ABI if abi >= first)) - 1
    has_scopes = abi >= SCOPED_SIGNALS_ABI
    scoped = _SCOPE_ABSTRACT_SOCKETS | _SCOPE_SIGNALS if has_scopes else 0
    attributes = _RulesetAttr(handled, 0, scoped)
    size = ctypes.sizeof(attributes) if has_scopes else 8  # what an old kernel knows
    ruleset = _check(_syscall(_CREATE_RULESET, ctypes.byref(attributes), size, 0))
    try:
        for path in readable:
            _allow(ruleset, path, _READ & handled)
        for path in writable:
            _allow(ruleset, path, _WRITE & handled)
        forbid_new_privileges()
        _check(_syscall(_RESTRICT_SELF, ruleset, 0))
    finally:
        os.close(ruleset)
    return True


def _allow(ruleset: int, path: Path, rights: int) -> None:
    try:
        descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except (FileNotFoundError, NotADirectoryError):
        return
    try:
        if not stat.S_ISDIR(os.fstat(descriptor).st_mode):
            rights &= _FILE_RIGHTS
        rule = _PathBeneathAttr(rights, descriptor)
        _check(_syscall(_ADD_RULE, ruleset, _PATH_BENEATH, ctypes.byref(rule), 0))
    finally:
        os.close(descriptor)


def _syscall(number: int, *arguments: object) -> int:
    libc = ctypes.CDLL(None, use_errno=True)
    status: int = libc.syscall(ctypes.c_long(number), *arguments)
    return status


def _check(status: int) -> int:
    if status < 0:
        code = ctypes.get_errno()
        raise OSError(code, f"Landlock: {os.strerror(code)}")
    return status
