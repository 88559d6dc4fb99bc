"""Experiment 2: error against uniform outliers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from benchmarks.comparison import (
    Row,
    absent,
    by_method,
    compare,
    curves,
    described,
    measured,
    settings_text,
    values,
)
from benchmarks.experiment import DATA, Experiment, Result, markdown, timed
from benchmarks.methods import (
    CPD,
    FGR,
    FILTERREG,
    FPFH_RANSAC,
    KISS,
    LM_ICP,
    MPE,
    MPL,
    MPL_PAPER,
    PCL_LM_ICP,
    PCL_TRIMMED_ICP,
    TRIMMED_ICP,
)
from benchmarks.paper.trials import anywhere
from mpe_core import register
from tests.factories.checks import pose_error
from tests.factories.clouds import Trial, bunny, moved

COUNTS = (0, 200, 950, 3000, 9000)
BOTH = {"noise": 0.04, "outliers": 3000}
SEEDS = 50
RIGHT = 5.0
PEERS = [KISS, FPFH_RANSAC, FGR]
NEAR = {  # starts: the methods that are given so many, the slower the fewer
    5: [MPL, MPL_PAPER, MPE, TRIMMED_ICP, PCL_LM_ICP],
    2: [LM_ICP, PCL_TRIMMED_ICP, FILTERREG],
}
MAX_CPD_OUTLIERS = 950  # with more a run takes minutes


def _anywhere() -> Iterator[tuple[Row, Trial]]:
    cloud = bunny(DATA)
    cases = {f"{count:,}": {"outliers": count} for count in COUNTS}
    for case, disturbed in (cases | {"3,000 and sigma 0.04": BOTH}).items():
        for seed in range(SEEDS):
            yield {"start": "any", "outliers": case}, anywhere(cloud, seed, **disturbed)


def _near(trials: int, max_outliers: int) -> Iterator[tuple[Row, Trial]]:
    cloud = bunny(DATA)
    for count in (count for count in COUNTS if count <= max_outliers):
        for seed in range(trials):
            trial = moved(cloud, np.random.default_rng(seed), outliers=count)
            yield {"start": "near", "outliers": count}, trial


def _ours() -> list[Row]:
    rows = []
    for labels, trial in _anywhere():
        found, seconds = timed(register, trial.source, trial.target)
        degrees, shift = pose_error(found.T_target_source, trial.T_target_source, trial.source)
        row = {"method": MPL.name, "degrees": degrees, "shift": shift, "seconds": seconds}
        rows.append(labels | row | {"accepted": found.accepted})
    return rows


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    rows = _ours() + compare(PEERS, _anywhere())
    for trials, methods in NEAR.items():
        rows += compare(methods, _near(trials, max(COUNTS)))
    rows += compare([CPD], _near(1, MAX_CPD_OUTLIERS))
    methods = [*[method for group in NEAR.values() for method in group], CPD, *PEERS]
    return {"rows": rows, "methods": described(methods)}


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    near, far = ([r for r in result["rows"] if r["start"] == start] for start in ("near", "any"))
    starts = ", ".join(f"{n} for {', '.join(m.name for m in group)}" for n, group in NEAR.items())
    names = [name for name in measured(result) if any(r["method"] == name for r in near)]
    columns = ("outliers", *(f"{count:,}" for count in COUNTS))
    return (
        "Bunny of 1,889 points, radius 1, outliers uniform in its bounding box. The paper shows "
        f"curves up to 3,000, its own near zero.\n{settings_text(result['methods'])}.\n\n"
        f"Turned evenly over SO(3), {SEEDS} starts: how many end within {RIGHT:.0f} degrees, and "
        "of MPL how many of those, and of the wrong ones, are accepted:\n\n"
        + _successes(far)
        + "\n\nTurned by up to 90 degrees, as in the paper; median rotation error in degrees; "
        f"starts: {starts}, 1 for CPD:\n\n"
        + markdown(
            columns,
            [*by_method(near, "degrees", "outliers", names), *absent(result, len(columns))],
        )
    )


def _successes(rows: list[Row]) -> str:
    lines = []
    for case in dict.fromkeys(r["outliers"] for r in rows):
        ours = [r for r in rows if r["outliers"] == case and r["method"] == MPL.name]
        right = [r["accepted"] for r in ours if r["degrees"] < RIGHT]
        wrong = [r["accepted"] for r in ours if r["degrees"] >= RIGHT]
        peers = [values(rows, "degrees", outliers=case, method=peer.name) for peer in PEERS]
        median = float(np.median([r["degrees"] for r in ours]))
        counts = (len(right), sum(right), sum(wrong), *((p < RIGHT).sum() for p in peers))
        lines.append((case, *counts, median))
    columns = ("outliers", MPL.name, "right accepted", "wrong accepted", *(p.name for p in PEERS))
    return markdown((*columns, "MPL, median degrees"), lines)


def draw(result: Result, figure: Figure) -> None:
    """Draw the page's picture."""
    axes = figure.subplots()
    curves(axes, [r for r in result["rows"] if r["start"] == "near"], "outliers", "degrees")
    axes.set(xlabel="outliers", ylabel="degrees, median", title="start up to 90 degrees")
    axes.set_yscale("symlog", linthresh=0.1)
    axes.legend()


OUTLIERS = Experiment("paper_outliers", "Error against outliers", run, table, draw)
