"""Experiment 1: error against Gaussian noise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from benchmarks.comparison import Row, compare, curves, described, medians, settings_text
from benchmarks.experiment import DATA, Experiment, Result, markdown
from benchmarks.methods import LOCAL, MPL, Method
from mpe_core.rigid import fit
from tests.clouds import Trial, bunny, moved

SIGMAS = (0.0, 0.01, 0.02, 0.04, 0.08, 0.16)
TRIALS = 5
FLOOR = Method("known pairs", "mpe", fit, "closed-form fit to the true pairs: the physical limit")


def _trials() -> Iterator[tuple[Row, Trial]]:
    cloud = bunny(DATA)
    for sigma in SIGMAS:
        for seed in range(TRIALS):
            yield {"sigma": sigma}, moved(cloud, np.random.default_rng(seed), noise=sigma)


def run() -> Result:
    methods = [FLOOR, MPL, *LOCAL]
    return {"rows": compare(methods, _trials()), "methods": described(methods)}


def table(result: Result) -> str:
    return (
        f"Bunny of 1,889 points, radius 1, turned by up to 90 degrees; median rotation error in "
        f"degrees of {TRIALS} starts. The paper has curves only, and claims an error at least "
        f"66.5 % below the others'.\n{settings_text(result['methods'])}.\n\n"
        + markdown(("sigma", *result["methods"]), medians(result["rows"], "sigma", "degrees"))
    )


def draw(result: Result, figure: Figure) -> None:
    axes = figure.subplots()
    curves(axes, result["rows"], "sigma", "degrees")
    axes.set(xlabel="sigma of the noise, radius 1", ylabel="degrees, median", yscale="symlog")
    axes.set_yscale("symlog", linthresh=0.1)
    axes.legend()


NOISE = Experiment("paper_noise", "Error against noise", run, table, draw)
