"""Time of registrations on one and on all threads, beside other work."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from benchmarks.experiment import DATA, PROJECT, Experiment, Result, markdown

PAIRS = ("bunny_bun045_bun000", "dragon_24_0", "kitti10m_010", "livingroom1_1_0")
ROUNDS = 3
BUSY = (0, 2, 8)
ONE_CORE, THROTTLED = "one core for all threads", "stopped beyond one core's time"
MAX_SLOWER = 1.1
"""Time of all threads over that of one up to which threads do no harm."""

PERIOD, LOOK = 0.1, 0.002
"""Seconds of a period of the throttle, as those of control groups, and between two looks at the
time that a process has used."""
WAYS = {
    "1 thread": {"NUMBA_NUM_THREADS": "1"},
    "all threads": {},
    "all threads, OpenMP's own waiting": {"OMP_WAIT_POLICY": "undefined", "GOMP_SPINCOUNT": ""},
}
MEASURE = """
import json, sys, os
from benchmarks.experiment import DATA, timed
from mpe_core import register
from tests.factories.clouds import real_pair
trials = [real_pair(DATA, name) for name in sys.argv[2].split(",")]
register(trials[0].source, trials[0].target)
if sys.argv[1] == "core":
    for thread in os.listdir("/proc/self/task"):
        os.sched_setaffinity(int(thread), {min(os.sched_getaffinity(0))})
print(sum(timed(register, trial.source, trial.target)[1] for trial in trials))
"""


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    rows = []
    for _ in range(ROUNDS):
        for busy in BUSY:
            with _busy_processes(busy):
                rows += [_row(way, f"{busy} busy processes") for way in WAYS]
        for limited in (ONE_CORE, THROTTLED):
            rows += [_row(way, limited) for way in WAYS]
    return {"rows": rows}


def _row(way: str, beside: str) -> Result:
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMP_", "GOMP_"))}
    environment |= {k: v for k, v in WAYS[way].items() if v}
    process = subprocess.Popen(
        [sys.executable, "-c", MEASURE, "core" if beside == ONE_CORE else "all", ",".join(PAIRS)],
        env=environment | {"MPE_DATA": str(DATA)},
        cwd=PROJECT,
        stdout=subprocess.PIPE,
        text=True,
    )
    if beside == THROTTLED:
        _throttle(process)
    output, _ = process.communicate()
    if process.returncode:
        raise RuntimeError(f"the measurement ended with {process.returncode}: see its error above")
    row = {"way": way, "beside": beside, "seconds": float(output)}
    print(json.dumps(row), flush=True)
    return row


def _throttle(process: subprocess.Popen[str]) -> None:
    """Give the process one core's time in each period, as the kernel's bandwidth control does.

    It is stopped until the next period once it has used that; unused time is lost.
    """
    begin, before, is_stopped = time.monotonic(), _used(process.pid), False
    while process.poll() is None:
        now, used = time.monotonic(), _used(process.pid)
        if now - begin >= PERIOD:
            begin, before = begin + PERIOD, min(used, before + PERIOD)
        if (used - before >= PERIOD) != is_stopped:
            is_stopped = not is_stopped
            process.send_signal(signal.SIGSTOP if is_stopped else signal.SIGCONT)
        time.sleep(LOOK)


def _used(pid: int) -> float:
    """Processor time of a process and its threads, in seconds."""
    stat = Path(f"/proc/{pid}/stat").read_text()
    fields = stat.rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def _busy_processes(count: int) -> Iterator[None]:
    """Run processes that do nothing but compute."""
    program = [sys.executable, "-c", "while True: pass"]
    processes = [subprocess.Popen(program) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    besides = list(dict.fromkeys(row["beside"] for row in result["rows"]))
    rows = []
    for beside in besides:
        seconds = [
            [r["seconds"] for r in result["rows"] if (r["way"], r["beside"]) == (way, beside)]
            for way in WAYS
        ]
        medians = [float(np.median(each)) for each in seconds]
        slower = medians[1] / medians[0]
        verdict = "as wanted" if slower <= MAX_SLOWER else "slower"
        rows.append((beside, *medians, slower, verdict))
    return (
        f"Seconds of {len(PAIRS)} real pairs, median of {ROUNDS} rounds in turn, each in a process "
        f"of its own that is warm, on {os.cpu_count()} cores. Wanted: all threads take at most "
        f"{MAX_SLOWER} of the time of one. A throttle stops the process when it has used the time "
        "of one core in a period of 0.1 s, until the next one.\n\n"
        + markdown(("beside", *WAYS, "all threads over one", "verdict"), rows)
    )


THREADS = Experiment("threads", "Threads beside other work", run, table)
