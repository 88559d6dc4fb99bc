"""Speed of the direct sum."""

from __future__ import annotations

import numba
import numpy as np

from benchmarks.experiment import Experiment, Result, markdown, timed
from mpe_core.potential import ExactField

COUNTS = (1889, 8171, 35947)
REPEATS = 9


def run() -> Result:
    rows = []
    before = numba.get_num_threads()
    for count in COUNTS:
        x, y = np.random.default_rng(0).normal(size=(2, count, 3))
        field = ExactField(y, 0.1)
        for threads in sorted({1, before}):
            numba.set_num_threads(threads)
            field.force(x)
            seconds = min(timed(field.force, x)[1] for _ in range(REPEATS))
            rows.append({"points": count, "threads": threads, "seconds": seconds})
    numba.set_num_threads(before)
    return {"rows": rows}


def table(result: Result) -> str:
    rows = [
        (r["points"], r["threads"], r["seconds"], r["points"] ** 2 / r["seconds"] / 1e9)
        for r in result["rows"]
    ]
    text = f"Forces of Eq. 7 on N points from N points, float32; fastest of {REPEATS} calls.\n\n"
    return text + markdown(("points", "threads", "seconds", "billion pairs/s"), rows)


KERNELS = Experiment("kernels", "Direct sum over all pairs", run, table)
