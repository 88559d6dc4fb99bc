"""A seccomp filter that takes the network and other processes from a child process (Linux).

Network namespaces need privileges that containers drop; a filter needs none. It is written by hand
because the bindings of libseccomp are unmaintained or need the library at run time, and a list of
denied calls needs no compiler of filters.
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import struct
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from service.workers.sandbox.system_calls import (
    DENIED,
    NETWORK,
    ONLY_OWN_PROCESS,
    ONLY_THIS_PROCESS,
    SYSTEM_CALLS,
    WITHOUT_OWNER,
)


@dataclass(frozen=True, slots=True)
class _Architecture:
    audit_arch: int
    """AUDIT_ARCH_* of include/uapi/linux/audit.h."""
    column: int
    """Column of its numbers in SYSTEM_CALLS."""


_ARCHITECTURES = {"x86_64": _Architecture(0xC000003E, 0), "aarch64": _Architecture(0xC00000B7, 1)}
_X32_BIT = 0x40000000
"""Bit of the calls of x86's third ABI, which has the same calls under other numbers."""

_LOAD, _RETURN = 0x20, 0x06
_JUMP_IF_EQUAL, _JUMP_IF_AT_LEAST, _JUMP_IF_SET = 0x15, 0x35, 0x45
_NUMBER, _ARCHITECTURE, _FIRST_ARGUMENT, _SECOND_ARGUMENT = 0, 4, 16, 24
"""Offsets in struct seccomp_data; of an argument its lower 32 bits."""
_KILL, _ALLOW = 0x80000000, 0x7FFF0000
_DENY, _UNKNOWN = 0x00050000 | errno.EACCES, 0x00050000 | errno.ENOSYS
_PR_GET_SECCOMP, _PR_SET_NO_NEW_PRIVS = 21, 38
_SET_MODE_FILTER, _ALL_THREADS = 1, 1
_CLONE_THREAD = 0x10000
_PR_SET_PDEATHSIG = 1
_AF_INET, _AF_INET6, _AF_NETLINK = 2, 10, 16

_Step = tuple[int, int, int, int]
"""Code, jump if true, jump if false, value: an instruction of classic BPF."""


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("filter", ctypes.c_char_p))


def has_seccomp() -> bool:
    """Return whether `filter_system_calls` can succeed on this system."""
    if sys.platform != "linux" or platform.machine() not in _ARCHITECTURES:
        return False
    return bool(ctypes.CDLL(None).prctl(_PR_GET_SECCOMP, 0, 0, 0, 0) >= 0)


def forbid_new_privileges() -> bool:
    """Forbid this process to gain privileges by exec; Landlock and seccomp require it."""
    return bool(ctypes.CDLL(None).prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0)


def filter_system_calls(*, network: bool) -> bool:
    """Take other processes, new processes and the kernel's wider interfaces, irrevocably.

    It holds for all threads of this process.

    Parameters
    ----------
    network : bool
        Whether Internet sockets stay allowed.

    Returns
    -------
    bool
        False where that is impossible: not Linux, another processor, a kernel without seccomp.
    """
    architecture = _ARCHITECTURES.get(platform.machine())
    if sys.platform != "linux" or architecture is None or not forbid_new_privileges():
        return False
    steps = b"".join(struct.pack("=HBBI", *step) for step in _filter(architecture, network))
    program = _Program(len(steps) // 8, steps)
    number = SYSTEM_CALLS["seccomp"][architecture.column]
    libc = ctypes.CDLL(None)
    status: int = libc.syscall(number, _SET_MODE_FILTER, _ALL_THREADS, ctypes.byref(program))
    return status == 0


def _filter(architecture: _Architecture, network: bool) -> Iterator[_Step]:
    def number(name: str) -> int | None:
        return SYSTEM_CALLS[name][architecture.column]

    yield from (
        (_LOAD, 0, 0, _ARCHITECTURE),
        (_JUMP_IF_EQUAL, 1, 0, architecture.audit_arch),
        (_RETURN, 0, 0, _KILL),
        (_LOAD, 0, 0, _NUMBER),
        (_JUMP_IF_AT_LEAST, 0, 1, _X32_BIT),
        (_RETURN, 0, 0, _DENY),
    )
    denied = DENIED if network else DENIED + NETWORK
    for name in denied:
        yield from _on(number(name), (_RETURN, 0, 0, _DENY))
    yield from _on(number("clone3"), (_RETURN, 0, 0, _UNKNOWN))  # libc falls back to clone
    yield from _on(number("clone"), *_if_argument(_JUMP_IF_SET, [_CLONE_THREAD], _ALLOW, _DENY))
    yield from _on(
        number("prctl"), *_if_argument(_JUMP_IF_EQUAL, [_PR_SET_PDEATHSIG], _DENY, _ALLOW)
    )
    for name in ONLY_OWN_PROCESS:
        yield from _on(number(name), *_if_argument(_JUMP_IF_EQUAL, [os.getpid()], _ALLOW, _DENY))
    for name in ONLY_THIS_PROCESS:
        yield from _on(number(name), *_if_argument(_JUMP_IF_EQUAL, [0], _ALLOW, _DENY))
    for name, commands in WITHOUT_OWNER.items():
        steps = _if_argument(_JUMP_IF_EQUAL, commands, _DENY, _ALLOW, which=_SECOND_ARGUMENT)
        yield from _on(number(name), *steps)
    families = [_AF_INET, _AF_INET6, _AF_NETLINK]  # getaddrinfo asks netlink
    yield from _on(number("socket"), *_if_argument(_JUMP_IF_EQUAL, families, _ALLOW, _DENY))
    yield (_RETURN, 0, 0, _ALLOW)


def _on(number: int | None, *steps: _Step) -> Iterator[_Step]:
    """Yield steps, which must return, for the system call of this number."""
    if number is not None:
        yield (_JUMP_IF_EQUAL, 0, len(steps), number)
        yield from steps


def _if_argument(
    test: int, values: Sequence[int], then: int, otherwise: int, *, which: int = _FIRST_ARGUMENT
) -> Iterator[_Step]:
    """Yield steps that return `then` if an argument passes the test with a value."""
    yield (_LOAD, 0, 0, which)
    for i, value in enumerate(values):
        yield (test, len(values) - i, 0, value)
    yield (_RETURN, 0, 0, otherwise)
    yield (_RETURN, 0, 0, then)
