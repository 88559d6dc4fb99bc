"""No network for a process that reads strangers' files: a seccomp filter, for good (Linux).

Namespaces would need privileges that a container takes away; a filter needs none. There is no
maintained binding that ships without libseccomp, and this one list needs no compiler of filters.
"""

from __future__ import annotations

import ctypes
import errno
import platform
import struct
import sys

# numbers of arch/x86/entry/syscalls/syscall_64.tbl and include/uapi/asm-generic/unistd.h; opening
# a socket, or taking one from another process
_ARCHITECTURES: dict[str, tuple[int, int, dict[str, int]]] = {
    "x86_64": (
        0xC000003E,
        317,
        {
            "socket": 41,
            "connect": 42,
            "ptrace": 101,
            "process_vm_readv": 310,
            "process_vm_writev": 311,
            "io_uring_setup": 425,
            "pidfd_getfd": 438,
        },
    ),
    "aarch64": (
        0xC00000B7,
        277,
        {
            "ptrace": 117,
            "socket": 198,
            "connect": 203,
            "process_vm_readv": 270,
            "process_vm_writev": 271,
            "io_uring_setup": 425,
            "pidfd_getfd": 438,
        },
    ),
}
"""AUDIT_ARCH, the number of seccomp itself, and what is denied."""
_X32 = 0x40000000
"""Bit of the calls of x86's third ABI, which are the others' under other numbers."""

_LOAD, _JUMP_IF_EQUAL, _JUMP_IF_AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06
_NUMBER_OFFSET, _ARCHITECTURE_OFFSET = 0, 4
_KILL, _DENY, _ALLOW = 0x80000000, 0x00050000 | errno.EACCES, 0x7FFF0000
_PR_SET_NO_NEW_PRIVS = 38
_SET_MODE_FILTER, _ALL_THREADS = 1, 1


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("filter", ctypes.c_char_p))


def drop_network() -> bool:
    """Take the network from this process, its threads and its children.

    False where that cannot be done: not on Linux, another processor, a kernel without seccomp.
    """
    known = _ARCHITECTURES.get(platform.machine())
    if sys.platform != "linux" or known is None:
        return False
    architecture, seccomp, denied = known
    instructions = _filter(architecture, sorted(denied.values()))
    program = _Program(len(instructions) // 8, instructions)
    libc = ctypes.CDLL(None)
    if libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
        return False
    done: int = libc.syscall(seccomp, _SET_MODE_FILTER, _ALL_THREADS, ctypes.byref(program))
    return done == 0


def _filter(architecture: int, denied: list[int]) -> bytes:
    """Classic BPF: code, steps to jump if so, steps if not, value."""
    count = len(denied)
    steps = [
        (_LOAD, 0, 0, _ARCHITECTURE_OFFSET),
        (_JUMP_IF_EQUAL, 1, 0, architecture),
        (_RETURN, 0, 0, _KILL),
        (_LOAD, 0, 0, _NUMBER_OFFSET),
        (_JUMP_IF_AT_LEAST, count + 1, 0, _X32),
        *((_JUMP_IF_EQUAL, count - i, 0, number) for i, number in enumerate(denied)),
        (_RETURN, 0, 0, _ALLOW),
        (_RETURN, 0, 0, _DENY),
    ]
    return b"".join(struct.pack("=HBBI", *step) for step in steps)
