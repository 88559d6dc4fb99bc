"""A seccomp filter that takes the network from a process that reads strangers' files (Linux).

Network namespaces need privileges that containers drop; a filter needs none. It is written by hand
because the bindings of libseccomp are unmaintained or need the library at run time, and a list of
seven denied calls needs no compiler of filters.
"""

from __future__ import annotations

import ctypes
import errno
import platform
import struct
import sys
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class _Architecture:
    audit_arch: int
    """AUDIT_ARCH_* of include/uapi/linux/audit.h."""
    seccomp: int
    """Number of the system call seccomp."""
    denied: tuple[int, ...]
    """Calls that open a socket, or take one from another process, in ascending order."""


# numbers of arch/x86/entry/syscalls/syscall_64.tbl and include/uapi/asm-generic/unistd.h: socket,
# connect, ptrace, process_vm_readv, process_vm_writev, io_uring_setup, pidfd_getfd
_ARCHITECTURES = {
    "x86_64": _Architecture(0xC000003E, 317, (41, 42, 101, 310, 311, 425, 438)),
    "aarch64": _Architecture(0xC00000B7, 277, (117, 198, 203, 270, 271, 425, 438)),
}
_X32_BIT = 0x40000000
"""Bit of the calls of x86's third ABI, which has the same calls under other numbers."""

_LOAD, _JUMP_IF_EQUAL, _JUMP_IF_AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06
_NUMBER_OFFSET, _ARCHITECTURE_OFFSET = 0, 4
_KILL, _DENY, _ALLOW = 0x80000000, 0x00050000 | errno.EACCES, 0x7FFF0000
_PR_SET_NO_NEW_PRIVS = 38
_SET_MODE_FILTER, _ALL_THREADS = 1, 1


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("filter", ctypes.c_char_p))


def drop_network() -> bool:
    """Take the network from this process, its threads and its children, irrevocably.

    Returns
    -------
    bool
        False where that is impossible: not Linux, another processor, a kernel without seccomp.
    """
    architecture = _ARCHITECTURES.get(platform.machine())
    if sys.platform != "linux" or architecture is None:
        return False
    instructions = _filter(architecture)
    program = _Program(len(instructions) // 8, instructions)
    libc = ctypes.CDLL(None)
    if libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
        return False
    status: int = libc.syscall(
        architecture.seccomp, _SET_MODE_FILTER, _ALL_THREADS, ctypes.byref(program)
    )
    return status == 0


def _filter(architecture: _Architecture) -> bytes:
    """Return the program in classic BPF: code, jump if true, jump if false, value."""
    count = len(architecture.denied)
    steps = [
        (_LOAD, 0, 0, _ARCHITECTURE_OFFSET),
        (_JUMP_IF_EQUAL, 1, 0, architecture.audit_arch),
        (_RETURN, 0, 0, _KILL),
        (_LOAD, 0, 0, _NUMBER_OFFSET),
        (_JUMP_IF_AT_LEAST, count + 1, 0, _X32_BIT),
        *((_JUMP_IF_EQUAL, count - i, 0, number) for i, number in enumerate(architecture.denied)),
        (_RETURN, 0, 0, _ALLOW),
        (_RETURN, 0, 0, _DENY),
    ]
    return b"".join(struct.pack("=HBBI", *step) for step in steps)
