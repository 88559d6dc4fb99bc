"""Speed of the direct sum, beside what the machine can do."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np

from benchmarks.experiment import Experiment, Result, markdown, timed
from mpe_core.potential import ExactField

COUNTS = (1889, 8171, 35947)
REPEATS = 9
FLOPS_OF_A_PAIR = 20  # 3 differences, 6 for the square, 4 with root and quotient, 6 for the sum
SIDE = 3000  # of the matrices of the yardstick


def run() -> Result:
    rows = []
    before = numba.get_num_threads()
    for count in COUNTS:
        x, y = np.random.default_rng(0).normal(size=(2, count, 3))
        field = ExactField(y, 0.1)
        for threads in sorted({1, before}):
            numba.set_num_threads(threads)
            rows.append({"points": count, "threads": threads, "seconds": _fastest(field.force, x)})
    numba.set_num_threads(before)
    square = np.random.default_rng(0).normal(size=(SIDE, SIDE)).astype(np.float32)
    return {"rows": rows, "flops": 2 * SIDE**3 / _fastest(np.matmul, square, square)}


def _fastest(call: Callable[..., object], *arguments: object) -> float:
    """Seconds of the fastest of some calls."""
    return min(timed(call, *arguments)[1] for _ in range(REPEATS))


def table(result: Result) -> str:
    rows = []
    for r in result["rows"]:
        pairs = r["points"] ** 2 / r["seconds"]
        share = f"{pairs * FLOPS_OF_A_PAIR / result['flops']:.0%}"
        rows.append((r["points"], r["threads"], r["seconds"], pairs / 1e9, share))
    return (
        f"Forces of Eq. 7 on N points from N points, float32; fastest of {REPEATS} calls. A pair "
        f"takes about {FLOPS_OF_A_PAIR} floating-point operations, a root and a quotient among "
        f"them; the yardstick is the float32 matrix product on all threads, "
        f"{result['flops'] / 1e9:.0f} Gflop/s. The points stay in the cache: memory sets no "
        "limit.\n\n"
        + markdown(("points", "threads", "seconds", "billion pairs/s", "of the yardstick"), rows)
    )


KERNELS = Experiment("kernels", "Direct sum over all pairs", run, table)
