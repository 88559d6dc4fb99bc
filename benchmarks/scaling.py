"""Time and memory of a registration against the number of points, and against the threads."""

from __future__ import annotations

import multiprocessing
import resource
from functools import partial

import numba
import numpy as np
from matplotlib.figure import Figure

from benchmarks.experiment import Experiment, Result, markdown, timed
from mpe_core import register
from tests.factories.checks import pose_error
from tests.factories.clouds import knot, moved

COUNTS = (1_000, 10_000, 100_000, 1_000_000, 10_000_000)
NOISE = 0.0005
REPEATS = 5
STAGES = ("prepare", "search", "refine", "inliers")
THREADS_AT = (10_000, 100_000, 1_000_000)


def _measure(count: int, threads: int) -> Result:
    """Register clouds of `count` points; runs in a process of its own to measure its memory."""
    numba.set_num_threads(threads)
    rng = np.random.default_rng(count)
    trial = moved(knot(count, rng), rng, largest_deg=180, noise=NOISE)
    small = knot(1000, rng)
    register(small, small)  # loads what the first call loads
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    seconds = []
    for _ in range(REPEATS):
        found, took = timed(register, trial.source, trial.target)
        seconds.append(took)
    return {
        "points": count,
        "threads": threads,
        "seconds": float(np.median(seconds)),
        "stages": found.timing,
        "extra_mb": (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024,
        "degrees": pose_error(found.T_target_source, trial.T_target_source, trial.source)[0],
    }


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    every = numba.get_num_threads()
    jobs = [(count, every) for count in COUNTS]
    jobs += [(count, threads) for count in THREADS_AT for threads in range(1, every)]
    rows = []
    for job in jobs:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            rows.append(pool.apply(partial(_measure, *job)))
    return {"rows": rows}


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    columns = ("points each", "threads", "seconds", "us a point", *STAGES)
    rows = [
        (
            r["points"],
            r["threads"],
            r["seconds"],
            1e6 * r["seconds"] / r["points"],
            *(r["stages"][stage] for stage in STAGES),
            round(r["extra_mb"]),
            r["degrees"],
        )
        for r in result["rows"]
    ]
    return (
        "A bent tube of N random surface points, with noise, onto another pose of it, turned by "
        f"up to 180 degrees; warm process, median of {REPEATS} calls; memory is what the process "
        "grew by in them; stages of the last. The noise stays as it is while the points get "
        "denser, so that more of them are about as near.\n\n"
        + markdown((*columns, "extra MB", "degrees off"), rows)
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the page's picture."""
    time, memory = figure.subplots(1, 2)
    every = max(r["threads"] for r in result["rows"])
    for threads in range(every, 0, -1):
        rows = [r for r in result["rows"] if r["threads"] == threads]
        points = [r["points"] for r in rows]
        time.plot(points, [r["seconds"] for r in rows], "o-", label=f"{threads} thread(s)")
    rows = [r for r in result["rows"] if r["threads"] == every]
    points = np.array([r["points"] for r in rows])
    linear = rows[-1]["seconds"] / points[-1] * points
    time.plot(points, linear, ":", color="grey", label="in proportion to the points")
    memory.plot(points, [r["extra_mb"] for r in rows], "o-")
    for axes, name in ((time, "seconds"), (memory, "MB that the process grew by")):
        axes.set(xlabel="points of each cloud", ylabel=name, xscale="log", yscale="log")
    time.legend()


SCALING = Experiment("scaling", "Time against points and threads", run, table, draw)
