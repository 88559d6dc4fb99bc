"""Children are where their supervisor needs them, and nowhere else."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PROJECT = Path(__file__).parents[4]

OUTLIVES_ITS_STARTER = """
import threading
from service.workers.child import Child, prepare_forkserver

children = []

def start():
    child = Child()
    children.append((child, child.wait_until_ready()))

prepare_forkserver(1)
for _ in range(2):
    thread = threading.Thread(target=start)
    thread.start()
    thread.join()
print([ready and child.is_alive for child, ready in children])
for child, _ in children:
    child.kill()
    child.close()
"""


def test_children_outlive_the_thread_that_asked_for_them() -> None:
    program = [sys.executable, "-c", OUTLIVES_ITS_STARTER]
    done = subprocess.run(program, cwd=PROJECT, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "[True, True]", done.stderr


STOPPED_FORKSERVER = """
import os, signal, time
from multiprocessing import forkserver
from service.workers import child as module
from service.workers.child import Child, prepare_forkserver, stop_forkserver

module.ANSWER_TIMEOUT_S = 0.5
prepare_forkserver(1)
first = Child()
first.wait_until_ready()
os.kill(forkserver._forkserver._forkserver_pid, signal.SIGSTOP)
second = Child()
begin = time.monotonic()
second.kill()
first.kill()
print(time.monotonic() - begin < 0.2)
third = Child()
print(third.wait_until_ready())
os.kill(forkserver._forkserver._forkserver_pid, signal.SIGSTOP)
fourth = Child()
for child in (first, second, third, fourth):
    child.kill()
    child.close()
stop_forkserver()
print("ended")
"""


def test_a_stopped_forkserver_is_replaced_and_holds_nobody() -> None:
    program = [sys.executable, "-c", STOPPED_FORKSERVER]
    done = subprocess.run(program, cwd=PROJECT, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["True", "True", "ended"], done.stderr
    assert "is replaced" in done.stderr
