"""Time of registrations on one and on all threads, beside other work."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from benchmarks.experiment import DATA, PROJECT, Experiment, Result, markdown

PAIRS = ("bunny_bun045_bun000", "dragon_24_0", "kitti10m_010", "livingroom1_1_0")
ROUNDS = 3
BUSY = (0, 2, 8)
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
        rows += [_row(way, "one core for all threads") for way in WAYS]
    return {"rows": rows}


def _row(way: str, beside: str) -> Result:
    where = "core" if "core" in beside else "all"
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMP_", "GOMP_"))}
    environment |= {k: v for k, v in WAYS[way].items() if v}
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, where, ",".join(PAIRS)],
        env=environment | {"MPE_DATA": str(DATA)},
        cwd=PROJECT,
        capture_output=True,
        text=True,
        check=True,
    )
    row = {"way": way, "beside": beside, "seconds": float(done.stdout)}
    print(json.dumps(row), flush=True)
    return row


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
        rows.append((beside, *(float(np.median(each)) for each in seconds)))
    return (
        f"Seconds of {len(PAIRS)} real pairs, median of {ROUNDS} rounds in turn, each in a process "
        "of its own that is warm.\n\n" + markdown(("beside", *WAYS), rows)
    )


THREADS = Experiment("threads", "Threads beside other work", run, table)
