"""Speed of the exact sum over all pairs, beside the limits of the machine."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
from matplotlib.figure import Figure

from benchmarks.experiment import Experiment, Result, markdown, timed
from benchmarks.roofs import bandwidth, peak_flops
from mpe_core.paper.force_field import ExactField

COUNTS = (1889, 8171, 35947)
REPEATS = 9
FLOPS_OF_A_PAIR = 20  # 3 differences, 6 for the square, 4 with root and quotient, 6 for the sum
POINT_BYTES, FORCE_BYTES = 12, 24  # three float32 in, three float64 out


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    rows = []
    every = numba.get_num_threads()
    for count in COUNTS:
        x, y = np.random.default_rng(0).normal(size=(2, count, 3))
        field = ExactField(y, 0.1)
        for threads in sorted({1, every}):
            numba.set_num_threads(threads)
            rows.append({"points": count, "threads": threads, "seconds": fastest(field.force, x)})
    numba.set_num_threads(every)
    return {"rows": rows, "flops": peak_flops(fastest), "bytes_per_s": bandwidth(fastest)}


def fastest(call: Callable[..., object], *arguments: object) -> float:
    """Return the seconds of the fastest of REPEATS calls."""
    return min(timed(call, *arguments)[1] for _ in range(REPEATS))


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    rows = []
    for r in result["rows"]:
        pairs = r["points"] ** 2 / r["seconds"]
        share = f"{pairs * FLOPS_OF_A_PAIR / result['flops']:.0%}"
        rows.append((r["points"], r["threads"], r["seconds"], pairs / 1e9, share))
    return (
        f"Forces of Eq. 7 on N points from N points, float32; fastest of {REPEATS} calls. A pair "
        f"takes about {FLOPS_OF_A_PAIR} floating-point operations, a root and a quotient among "
        "them. The roofs are measured in the same run on all threads: "
        f"{result['flops'] / 1e9:.0f} Gflop/s (the faster of a float32 matrix product and of "
        f"polynomials evaluated in the cache) and {result['bytes_per_s'] / 1e9:.1f} GB/s (the "
        "triad a = b + 3 c in memory). Each point is read from memory once and meets all others in "
        "the cache: memory sets no limit.\n\n"
        + markdown(("points", "threads", "seconds", "billion pairs/s", "of the peak"), rows)
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the roofline: operations a second over operations for each byte of memory."""
    axes = figure.subplots()
    intensity = np.geomspace(0.1, 1e5, 200)
    roof = np.minimum(result["flops"], intensity * result["bytes_per_s"])
    axes.plot(intensity, roof / 1e9, "k-", label="the machine: memory, then arithmetic")
    for threads in sorted({r["threads"] for r in result["rows"]}):
        mine = [r for r in result["rows"] if r["threads"] == threads]
        pairs = np.array([r["points"] ** 2 for r in mine])
        moved = np.array([r["points"] * (2 * POINT_BYTES + FORCE_BYTES) for r in mine])
        speed = pairs * FLOPS_OF_A_PAIR / np.array([r["seconds"] for r in mine]) / 1e9
        label = f"direct sum, {threads} thread(s), {', '.join(str(n) for n in COUNTS)} points"
        axes.plot(FLOPS_OF_A_PAIR * pairs / moved, speed, "o", label=label)
    axes.set(xlabel="operations for each byte", ylabel="Gflop/s", xscale="log", yscale="log")
    axes.legend()


KERNELS = Experiment("kernels", "Direct sum over all pairs", run, table, draw)
