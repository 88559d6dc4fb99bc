"""A sealed process has no network, in any of its threads, and nothing else is taken from it."""

from __future__ import annotations

import subprocess
import sys

SEALED = """
import os, socket, subprocess, sys, threading
import numpy as np
from service.workers.sandbox.seccomp import drop_network

kept = socket.socket()
idle = threading.Event()
found = []

def in_a_thread():
    idle.wait()
    found.append(denied(socket.socket))

def denied(call, *arguments):
    try:
        call(*arguments)
    except PermissionError:
        return True
    return False

thread = threading.Thread(target=in_a_thread)
thread.start()
assert drop_network()
idle.set()
thread.join()
assert found == [True]
assert denied(socket.socket)
assert denied(socket.socket, socket.AF_UNIX)
assert denied(kept.connect, ("127.0.0.1", 9))
child = "import socket\\ntry: socket.socket()\\nexcept PermissionError: print('denied')"
assert subprocess.check_output([sys.executable, "-c", child]) == b"denied\\n"
assert np.linalg.norm(np.ones((500, 500)) @ np.ones((500, 500))) > 0
print("sealed")
"""


def test_a_sealed_process_opens_no_socket() -> None:
    done = subprocess.run([sys.executable, "-c", SEALED], capture_output=True, text=True)
    assert done.stdout == "sealed\n", done.stderr
