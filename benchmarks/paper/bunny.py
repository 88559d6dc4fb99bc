"""The bunny of 1,889 points from fifty starts each: clean, noisy, with outliers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.comparison import Row, compare, described, settings_text, values
from benchmarks.experiment import DATA, Experiment, Result, markdown
from benchmarks.methods import MPL, MPL_PAPER
from tests.factories.clouds import Trial, bunny, moved

TRIALS = 50
CASES = {  # what is done to the source, degrees that count as right, how many must be
    "clean": ({}, 0.1, 50),
    "noise, sigma 0.02": ({"noise": 0.02}, 2.0, 50),
    "1,500 uniform outliers": ({"outliers": 1500}, 2.0, 45),
}


def _trials() -> Iterator[tuple[Row, Trial]]:
    cloud = bunny(DATA)
    for case, (disturbed, _, _) in CASES.items():
        for seed in range(TRIALS):
            yield {"case": case}, moved(cloud, np.random.default_rng(seed), **disturbed)


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    methods = [MPL, MPL_PAPER]
    return {"rows": compare(methods, _trials()), "methods": described(methods)}


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    rows = []
    for case, (_, limit, wanted) in CASES.items():
        for name in result["methods"]:
            degrees, seconds = (
                values(result["rows"], key, case=case, method=name)
                for key in ("degrees", "seconds")
            )
            right = f"{(degrees < limit).sum()}/{TRIALS} within {limit}"
            times = float(np.median(seconds))
            spread = (float(np.median(degrees)), float(degrees.max()))
            rows.append((case, name, right, f"{wanted}/{TRIALS}", *spread, times))
    columns = ("case", "method", "right", "wanted", "median degrees", "largest", "seconds")
    return (
        "Radius 1, turned by up to 90 degrees, moved by up to half a diagonal.\n"
        f"{settings_text(result['methods'])}.\n\n" + markdown(columns, rows)
    )


BUNNY = Experiment("paper_bunny", "The bunny from fifty starts", run, table)
