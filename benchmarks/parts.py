"""Small parts of real clouds on the whole: which are found, and which only pass for found."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import KDTree

from benchmarks.experiment import DATA, Experiment, Result, markdown
from benchmarks.recall import is_right
from mpe_core import register
from mpe_core.clouds.normalize import robust_radius
from mpe_core.geometry.rigid import apply
from mpe_core.options import ACCEPTANCE_THRESHOLD
from tests.factories.checks import pose_error
from tests.factories.clouds import Array, Pair, Trial, real_trial

FRACTIONS = (2, 3, 4, 6, 8)
"""Radius of the target over that of the parts."""
PAIRS_OF_A_SUITE, PARTS_OF_A_PAIR, TRIES = 4, 3, 60
MIN_POINTS = 800
COVERED, COVERED_WITHIN = 0.8, 0.03
"""Share of a part's points that have a point of the target at the true pose, and how near, in radii
of the target: others cannot be found."""


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    rows = []
    for pair in _some_of_each_suite():
        trial = real_trial(DATA, pair)
        for fraction, part in parts(trial):
            rows.append({"pair": pair["id"], "fraction": fraction} | _row(pair, trial, part))
    return {"rows": rows}


def _some_of_each_suite() -> Iterator[Pair]:
    taken: Counter[str] = Counter()
    for pair in json.loads((DATA / "pairs.json").read_text()):
        taken[pair["suite"]] += 1
        if taken[pair["suite"]] <= PAIRS_OF_A_SUITE:
            yield pair


def parts(trial: Trial) -> Iterator[tuple[int, Array]]:
    """Balls (N, 3) of the source about points drawn from it, each with its fraction."""
    rng = np.random.default_rng(0)
    tree = KDTree(trial.target[::4])
    whole = robust_radius(trial.target, trial.target.mean(axis=0))
    for fraction in FRACTIONS:
        found = 0
        for center in trial.source[rng.integers(len(trial.source), size=TRIES)]:
            if found == PARTS_OF_A_PAIR:
                break
            part = trial.source[np.linalg.norm(trial.source - center, axis=1) < whole / fraction]
            if len(part) < MIN_POINTS:
                continue
            distance, _ = tree.query(apply(trial.T_target_source, part[::20]))
            if np.mean(distance < COVERED_WITHIN * whole) >= COVERED:
                found += 1
                yield fraction, part


def _row(pair: Pair, trial: Trial, part: Array) -> Result:
    begin = time.perf_counter()
    found = register(part, trial.target)
    seconds = time.perf_counter() - begin
    degrees, shift = pose_error(found.T_target_source, trial.T_target_source, part)
    return {
        "points": len(part),
        "degrees": degrees,
        "shift": shift,
        "right": is_right(pair, degrees, shift),
        "confidence": found.confidence,
        "accepted": found.accepted,
        "ambiguous": found.ambiguous,
        "free": len(found.free_directions),
        "seconds": seconds,
    }


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    columns = (
        "radius",
        "parts",
        "right",
        "right, not accepted",
        "wrong, accepted",
        "of these neither `ambiguous` nor with a free direction",
        "median seconds",
    )
    groups = {f"1/{f}": [r for r in result["rows"] if r["fraction"] == f] for f in FRACTIONS}
    lines = [_line(name, rows) for name, rows in (groups | {"all": result["rows"]}).items()]
    return (
        f"Parts of a source of pairs.json on its target: up to {PAIRS_OF_A_SUITE} pairs of each "
        f"suite, turned at random over SO(3), and of each {PARTS_OF_A_PAIR} balls of each size, at "
        f"least {COVERED:.0%} of them over the target. Right by the tolerances of the whole pair, "
        "though a part tells its rotation the less exactly the smaller it is.\n\n"
        + markdown(columns, lines)
    )


def _line(name: str, rows: list[Result]) -> tuple[object, ...]:
    right = [row for row in rows if row["right"]]
    passed = [row for row in rows if row["accepted"] and not row["right"]]
    unsaid = [row for row in passed if not row["ambiguous"] and not row["free"]]
    return (
        name,
        len(rows),
        len(right),
        sum(not row["accepted"] for row in right),
        len(passed),
        len(unsaid),
        float(np.median([row["seconds"] for row in rows])),
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the page's picture."""
    axes = figure.subplots()
    rng = np.random.default_rng(0)
    for right, name in ((True, "right"), (False, "wrong")):
        rows = [row for row in result["rows"] if row["right"] == right]
        fraction = np.array([row["fraction"] for row in rows])
        place = fraction * np.exp(rng.uniform(-0.06, 0.06, len(rows)))
        axes.plot(place, [row["confidence"] for row in rows], ".", label=name)
    axes.axhline(ACCEPTANCE_THRESHOLD, color="grey", linewidth=1)
    axes.set(xscale="log", xlabel="radius of the target over that of the part")
    axes.set_xticks(FRACTIONS, [f"{fraction}" for fraction in FRACTIONS])
    axes.set_ylabel("confidence")
    axes.minorticks_off()
    figure.legend(loc="outside lower center", ncols=2)


PARTS = Experiment("parts", "Small parts on the whole", run, table, draw)
