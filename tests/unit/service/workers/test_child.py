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
