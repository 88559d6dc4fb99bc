"""Experiment 2: error against uniform outliers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from benchmarks.comparison import Row, compare, curves, described, medians, settings_text
from benchmarks.experiment import DATA, Experiment, Result, markdown
from benchmarks.methods import CPD, LM_ICP, MPL, MPL_PAPER, TRIMMED_ICP
from tests.clouds import Trial, bunny, moved

COUNTS = (0, 200, 950, 2800, 9000)
TRIALS = 3
MOST_OF_CPD = 950  # beyond it a run takes minutes


def _trials(most: int) -> Iterator[tuple[Row, Trial]]:
    cloud = bunny(DATA)
    for count in (count for count in COUNTS if count <= most):
        for seed in range(TRIALS):
            trial = moved(cloud, np.random.default_rng(seed), outliers=count)
            yield {"outliers": count}, trial


def run() -> Result:
    methods = [MPL, MPL_PAPER, TRIMMED_ICP, LM_ICP]
    rows = compare(methods, _trials(max(COUNTS))) + compare([CPD], _trials(MOST_OF_CPD))
    return {"rows": rows, "methods": described([*methods, CPD])}


def table(result: Result) -> str:
    return (
        f"Bunny of 1,889 points, radius 1, turned by up to 90 degrees, outliers uniform in its "
        f"box; median rotation error in degrees of {TRIALS} starts. The paper shows curves up to "
        f"3,000, its own near zero.\n{settings_text(result['methods'])}.\n\n"
        + markdown(("outliers", *result["methods"]), medians(result["rows"], "outliers", "degrees"))
    )


def draw(result: Result, figure: Figure) -> None:
    axes = figure.subplots()
    curves(axes, result["rows"], "outliers", "degrees")
    axes.set(xlabel="outliers", ylabel="degrees, median")
    axes.set_yscale("symlog", linthresh=0.1)
    axes.legend()


OUTLIERS = Experiment("paper_outliers", "Error against outliers", run, table, draw)
