"""Experiment 3: time against the number of points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from benchmarks.comparison import Row, by_method, compare, curves, described, settings_text
from benchmarks.experiment import DATA, Experiment, Result, markdown
from benchmarks.methods import CPD, EM_ICP, MPE, MPL, MPL_PAPER
from mpe_core.geometry.sampling import sample_points
from tests.factories.clouds import Trial, bunny, moved

SMALL, MEDIUM, LARGE = (1000, 2500), (5000, 7500), (15000, 25000, 35000)


def _trials(counts: tuple[int, ...]) -> Iterator[tuple[Row, Trial]]:
    cloud = bunny(DATA, "bun_zipper")
    for count in counts:
        rng = np.random.default_rng(count)
        yield {"points": count}, moved(sample_points(cloud, count, rng), rng)


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    everyone = [MPL, MPL_PAPER, MPE, EM_ICP, CPD]
    rows = []
    for methods, counts in ((everyone, SMALL), (everyone[:4], MEDIUM), (everyone[:3], LARGE)):
        rows += compare(methods, _trials(counts))
    return {"rows": rows, "methods": described(everyone)}


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    return (
        "Random parts of the bunny of 35,947 points, turned by up to 90 degrees; seconds. EM-ICP "
        "stops at 7,500 points, as in the paper, CPD at 2,500: it takes minutes then.\n"
        f"{settings_text(result['methods'])}.\n\n"
        + markdown(
            ("points", *(f"{count:,}" for count in SMALL + MEDIUM + LARGE)),
            by_method(result["rows"], "seconds", "points", list(result["methods"])),
        )
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the page's picture."""
    axes = figure.subplots()
    curves(axes, result["rows"], "points", "seconds")
    axes.set(xlabel="points", ylabel="seconds", xscale="log", yscale="log")
    axes.legend()


SIZE = Experiment("paper_size", "Time against size", run, table, draw)
