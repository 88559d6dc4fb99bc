"""The sandbox as a whole: what this system has of it, and its application to a child process."""

from __future__ import annotations

import functools
import logging
import os
import sys
import sysconfig
from collections.abc import Iterable
from pathlib import Path

from service.workers.sandbox.landlock import SCOPED_SIGNALS_ABI, landlock_abi, restrict_files
from service.workers.sandbox.seccomp import filter_system_calls, has_seccomp

SYSTEM_FILES = (
    "/lib",
    "/lib64",
    "/usr/lib",
    "/usr/lib64",
    "/usr/local/lib",
    "/etc/ld.so.cache",
    "/etc/localtime",
    "/usr/share/zoneinfo",
    "/dev/null",
    "/dev/urandom",
)
"""What libraries read; none of it is secret."""
NETWORK_FILES = (
    "/etc/hosts",
    "/etc/host.conf",
    "/etc/resolv.conf",
    "/etc/nsswitch.conf",
    "/etc/gai.conf",
    "/etc/services",
    "/etc/ssl",
    "/etc/pki",
    "/etc/ca-certificates",
    "/usr/share/ca-certificates",
    "/usr/local/share/ca-certificates",
)
"""What name resolution and TLS read besides."""

log = logging.getLogger(__name__)


class SandboxError(RuntimeError):
    """The sandbox is required, and this system lacks a part of it."""


def missing_parts() -> list[str]:
    """Return what this system lacks of the sandbox, in words; empty if it has everything."""
    missing = []
    if landlock_abi() == 0:
        missing.append(
            "Landlock (Linux 5.13 or later, enabled): "
            "a process that decodes files can read every file of the service"
        )
    if not has_seccomp():
        missing.append(
            "seccomp (Linux on x86-64 or ARM64): a process that decodes files keeps its network"
        )
    return missing


def describe_sandbox() -> str:
    """Describe what this system has of the sandbox, one part a line."""
    abi = landlock_abi()
    signals = "files and signals" if abi >= SCOPED_SIGNALS_ABI else "files"
    return "\n".join(
        [
            f"landlock    {f'version {abi}, confines {signals}' if abi else 'missing'}",
            f"seccomp     {'filters system calls' if has_seccomp() else 'missing'}",
        ]
    )


def check_sandbox(*, is_required: bool) -> None:
    """Log what this system lacks of the sandbox.

    Raises
    ------
    SandboxError
        Something is missing, and the sandbox is required.
    """
    for part in missing_parts():
        if is_required:
            raise SandboxError(f"MPE_REQUIRE_SANDBOX is set, but this system lacks {part}")
        log.warning("this system lacks %s", part)


def confine(
    readable: Iterable[Path], writable: Iterable[Path], *, network: bool, is_required: bool
) -> None:
    """Leave this process its libraries and these files, irrevocably; call it before any thread.

    Parameters
    ----------
    readable, writable : iterable of Path
        Files of the task, and folders with all that is below them.
    network : bool
        Whether Internet sockets stay allowed.
    is_required : bool
        Whether a missing part is an error.

    Raises
    ------
    SandboxError
        A part is missing, and the sandbox is required.
    """
    system = SYSTEM_FILES + NETWORK_FILES if network else SYSTEM_FILES
    is_confined = restrict_files([*library_paths(), *map(Path, system), *readable], writable)
    is_filtered = filter_system_calls(network=network)
    if is_required and not (is_confined and is_filtered):
        raise SandboxError("the sandbox is required, but this system lacks a part of it")


@functools.cache
def library_paths() -> tuple[Path, ...]:
    """Return the folders and files that the imported packages and the interpreter consist of.

    `sys.path` is not used: it may hold the working directory, and so the data.
    """
    names = ("stdlib", "platstdlib", "purelib", "platlib")
    roots = {Path(sysconfig.get_path(name)) for name in names}
    found = set(roots)
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if "." not in name and name != "__main__" and file is not None:
            path = Path(file)
            if not any(path.is_relative_to(root) for root in roots):
                found.add(path.parent if path.stem == "__init__" else path)
    for variable in ("NUMBA_CACHE_DIR", "SSL_CERT_FILE", "SSL_CERT_DIR"):
        if value := os.environ.get(variable):
            found.add(Path(value))
    return tuple(sorted(path for path in found if path.is_absolute()))
