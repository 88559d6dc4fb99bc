"""Children are where their supervisor needs them, and nowhere else."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.factories.waiting import until

PROJECT = Path(__file__).parents[4]

OUTLIVES_ITS_STARTER = """
import threading
from service.workers.child import Child, prepare_forkserver

children = []

def start():
    child = Child()
    children.append((child, child.is_ready(120)))

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


GIVES_WAY = """
import os
from pathlib import Path
from service.workers.sandbox.limits import AUTOGROUP, give_way

os.setsid()
give_way(3)
session = Path(AUTOGROUP)
print(os.nice(0), session.read_text().split()[-1] if session.exists() else os.nice(0))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="sessions have a niceness on Linux alone")
def test_a_worker_gives_way_with_its_session() -> None:
    niceness = str(min(19, os.nice(0) + 3))
    program = [sys.executable, "-c", GIVES_WAY]

    def said() -> list[str]:
        return subprocess.run(program, cwd=PROJECT, capture_output=True, text=True).stdout.split()

    # set ten times a second, by all together, where that takes privileges
    until(lambda: said() == [niceness, niceness])
