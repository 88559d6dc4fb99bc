"""A filtered process has no network, no programs and no hold on others; its own work goes on."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from service.workers.sandbox.system_calls import (
    DENIED,
    NETWORK,
    ONLY_OWN_PROCESS,
    ONLY_THIS_PROCESS,
    SYSTEM_CALLS,
    WITHOUT_OWNER,
)

PROJECT = Path(__file__).parents[5]

PREAMBLE = """
import ctypes, fcntl, os, signal, socket, struct, subprocess, sys, threading
import numpy as np
from service.workers.sandbox.seccomp import filter_system_calls, has_seccomp

def denied(call, *arguments, **named):
    try:
        call(*arguments, **named)
    except PermissionError:
        return True
    return False

assert has_seccomp()
"""
WITHOUT_NETWORK = """
kept = socket.socket()
idle = threading.Event()
found = []

def in_a_thread():
    idle.wait()
    found.append(denied(socket.socket))

thread = threading.Thread(target=in_a_thread)
thread.start()
assert filter_system_calls(network=False)
idle.set()
thread.join()
assert found == [True]
assert denied(socket.socket)
assert denied(socket.socket, socket.AF_UNIX)
assert denied(kept.connect, ("127.0.0.1", 9))
assert denied(os.fork)
assert denied(subprocess.run, [sys.executable, "-c", ""])
assert denied(os.execv, sys.executable, [sys.executable, "-c", ""])
assert denied(os.kill, os.getppid(), 0)
assert denied(os.kill, 0, 0)
assert denied(os.kill, -1, 0)
assert denied(os.pidfd_open, os.getppid())
assert denied(os.unshare, os.CLONE_NEWUSER) if hasattr(os, "unshare") else True
libc = ctypes.CDLL(None, use_errno=True)
assert libc.prctl(1, 0, 0, 0, 0) == -1, "the signal at the parent's death"
assert libc.ptrace(16, os.getppid(), 0, 0) == -1
for call, *arguments in (
    (os.chmod, ".", 0o755),
    (os.chown, ".", -1, -1),
    (os.utime, "."),
    (os.setxattr, ".", "user.x", b""),
    (os.truncate, os.devnull, 0),
    (os.fchmod, 0, 0o600),
):
    assert denied(call, *arguments), call
for command in (fcntl.F_SETOWN, 10, 15):
    assert denied(fcntl.fcntl, kept, command, os.getppid())
for command in (0x8901, 0x8902):
    assert denied(fcntl.ioctl, kept, command, struct.pack("i", os.getppid()))
os.set_blocking(kept.fileno(), False)
os.set_inheritable(kept.fileno(), True)
os.kill(os.getpid(), 0)
thread = threading.Thread(target=lambda: None)
thread.start()
thread.join()
assert np.linalg.norm(np.ones((500, 500)) @ np.ones((500, 500))) > 0
print("filtered")
"""
WITH_NETWORK = """
assert filter_system_calls(network=True)
socket.socket().close()
socket.socket(socket.AF_INET6).close()
assert denied(socket.socket, socket.AF_UNIX)
socket.getaddrinfo("127.0.0.1", 80)
assert denied(os.fork)
assert denied(os.kill, os.getppid(), 0)
print("filtered")
"""


@pytest.mark.parametrize("program", [WITHOUT_NETWORK, WITH_NETWORK], ids=["without", "with"])
def test_a_filtered_process_keeps_to_itself(program: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PREAMBLE + program], cwd=PROJECT, capture_output=True, text=True
    )
    assert done.stdout == "filtered\n", done.stderr


def test_each_call_is_filtered_in_one_way() -> None:
    ways = [*DENIED, *NETWORK, *ONLY_OWN_PROCESS, *ONLY_THIS_PROCESS, *WITHOUT_OWNER]
    assert len(set(ways)) == len(ways)
    assert set(ways) | {"seccomp", "clone", "clone3", "prctl"} == set(SYSTEM_CALLS)


def test_no_two_calls_have_the_same_number() -> None:
    for column in (0, 1):
        numbers = [row[column] for row in SYSTEM_CALLS.values() if row[column] is not None]
        assert len(set(numbers)) == len(numbers)
