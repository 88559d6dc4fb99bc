"""A child runs at lower priority and within its limits."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from service.workers.sandbox.limits import forkserver_pid
from tests.factories.waiting import until

PROJECT = Path(__file__).parents[5]

LOWERS_PRIORITY = """
import os
from pathlib import Path
from service.workers.sandbox.limits import AUTOGROUP, lower_priority

os.setsid()
lower_priority(3)
autogroup = Path(AUTOGROUP)
print(os.nice(0), autogroup.read_text().split()[-1] if autogroup.exists() else os.nice(0))
"""
LIMITED = """
import os
from service.workers.sandbox.limits import ResourceLimits, apply_limits

apply_limits(ResourceLimits(memory_bytes=1 << 30, cpu_s=1))
assert os.getsid(0) == os.getpid()
try:
    bytearray(2 << 30)
except MemoryError:
    print("no memory", flush=True)
while True:
    pass
"""

VOLUNTEERS = """
from pathlib import Path
from service.workers.sandbox.limits import OOM_SCORE_ADJ, forbid_inspection, raise_oom_score

forbid_inspection()
raise_oom_score(700)
print(Path(OOM_SCORE_ADJ).read_text().strip())
"""


def run(program: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program], cwd=PROJECT, capture_output=True, text=True
    )


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has autogroups")
def test_priority_is_lowered_for_the_whole_session() -> None:
    niceness = str(min(19, os.nice(0) + 3))
    # the kernel lets unprivileged users renice ten sessions a second, together
    until(lambda: run(LOWERS_PRIORITY).stdout.split() == [niceness, niceness])


def test_memory_and_cpu_time_are_bounded() -> None:
    done = run(LIMITED)
    assert done.stdout == "no memory\n", done.stderr
    assert done.returncode < 0  # ended by the kernel


def test_a_process_that_was_not_forked_has_no_forkserver() -> None:
    with pytest.raises(RuntimeError, match="not forked"):
        forkserver_pid()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux scores processes")
def test_the_kernel_takes_a_job_before_the_service() -> None:
    assert run(VOLUNTEERS).stdout == "700\n"
