"""Real scenes of families that the method was not made on, with and without viewpoints."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from benchmarks.comparison import described, settings_text
from benchmarks.confidence import roc_area
from benchmarks.experiment import DATA, Experiment, Result, markdown, timed
from benchmarks.methods import FPFH_RANSAC, KISS
from benchmarks.recall import is_right
from mpe_core import RegistrationOptions, register
from mpe_core.geometry.rigid import inverse
from tests.factories.checks import pose_error
from tests.factories.clouds import Pair, Trial, real_trial, true_pose

SCENES = DATA / "scenes"
SEEDS = 3
OVERLAPS = ((0.3, 1.01), (0.15, 0.3), (0.0, 0.15))
OURS, WITH_VIEWPOINTS = "MPL", "MPL, viewpoints known"
PEERS = (KISS, FPFH_RANSAC)


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    rows = [row for pair, seed, trial in _trials() for row in _attempts(pair, seed, trial)]
    return {"rows": rows, "methods": described(PEERS)}


def _trials() -> Iterator[tuple[Pair, int, Trial]]:
    for pair in json.loads((SCENES / "pairs.json").read_text()):
        for seed in range(SEEDS):
            yield pair, seed, real_trial(SCENES, pair, seed=seed)


def _attempts(pair: Pair, seed: int, trial: Trial) -> Iterator[Result]:
    """Yield a row for each method: whether it is right, its errors, seconds, confidence."""
    labels = {key: pair[key] for key in ("id", "suite", "overlap", "viewpoints")} | {"seed": seed}
    for row in our_attempts(pair, trial):
        yield labels | row
    for peer in PEERS:
        if peer.version:
            T, seconds = timed(peer.register, trial.source, trial.target)
            yield labels | _errors(pair, trial, T) | {"method": peer.name, "seconds": seconds}


def our_attempts(pair: Pair, trial: Trial) -> Iterator[Result]:
    """Yield a row without viewpoints, and one with them where they are known."""
    ways = {OURS: RegistrationOptions()}
    if pair["viewpoints"]:
        ways[WITH_VIEWPOINTS] = viewpoint_options(pair, trial)
    for name, options in ways.items():
        found, seconds = timed(register, trial.source, trial.target, options)
        yield {
            **_errors(pair, trial, found.T_target_source),
            "method": name,
            "seconds": seconds,
            "confidence": found.confidence,
            "accepted": found.accepted,
            "ambiguous": found.ambiguous,
        }


def viewpoint_options(pair: Pair, trial: Trial) -> RegistrationOptions:
    """Return options with both viewpoints: the origins of the files, the source's moved with it."""
    moved = inverse(trial.T_target_source) @ true_pose(pair)
    x, y, z = moved[:3, 3].tolist()
    return RegistrationOptions(source_viewpoint=(x, y, z), target_viewpoint=(0.0, 0.0, 0.0))


def _errors(pair: Pair, trial: Trial, T: np.ndarray) -> Result:
    degrees, shift = pose_error(T, trial.T_target_source, trial.source)
    return {"right": is_right(pair, degrees, shift), "degrees": degrees, "shift": shift}


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    rows = result["rows"]
    names = list(dict.fromkeys(row["method"] for row in rows))
    families = dict.fromkeys(row["suite"] for row in rows)
    ours = [name for name in names if name in (OURS, WITH_VIEWPOINTS)]
    bands = {f"{low:g} to {min(high, 1):g}": _between(low, high) for low, high in OVERLAPS}
    suites = {name: _of_suite(name) for name in families}
    return (
        f"{len({row['id'] for row in rows})} pairs of {len(families)} families, {SEEDS} starts"
        " each, turned at random over SO(3) and moved; right by the tolerances of the pair. With"
        " viewpoints: of the pairs whose scanners stood at the origins of their files. The weights"
        " of what contradicts a pose (free space, layers), the margin of free space, places of full"
        " sight, the effort of the levelled search and the narrower planes at the end were chosen"
        " with these pairs in view; everything else was not.\n"
        f"{settings_text(result['methods'])}.\n\n"
        "## Right\n\n"
        + markdown(("", *names), [_line(rows, names, "all", lambda row: True)])
        + "\n\n### By overlap\n\n"
        + markdown(("overlap", *names), [_line(rows, names, k, v) for k, v in bands.items()])
        + "\n\n### By family\n\n"
        + markdown(("family", *names), [_line(rows, names, k, v) for k, v in suites.items()])
        + "\n\n## What MPL says of its poses\n\n"
        + markdown(
            (
                "",
                "starts",
                "right",
                "wrong and accepted",
                "right but refused",
                "area under ROC",
                "median seconds",
                "95 %",
            ),
            [verdicts(name, [row for row in rows if row["method"] == name]) for name in ours],
        )
    )


def _between(low: float, high: float) -> Callable[[Result], bool]:
    return lambda row: low <= row["overlap"] < high


def _of_suite(name: str) -> Callable[[Result], bool]:
    return lambda row: row["suite"] == name


def _line(
    rows: Sequence[Result], names: Sequence[str], label: str, is_wanted: Callable[[Result], bool]
) -> list[object]:
    cells: list[object] = [label]
    for name in names:
        mine = [row for row in rows if row["method"] == name and is_wanted(row)]
        right = sum(row["right"] for row in mine)
        cells.append(f"{right}/{len(mine)} ({right / len(mine):.0%})" if mine else "-")
    return cells


def verdicts(name: str, rows: Sequence[Result]) -> list[object]:
    """Return a line of a table: how many of the poses are right, and what is said of them."""
    right = np.array([row["right"] for row in rows])
    accepted = np.array([row["accepted"] for row in rows])
    confidence = np.array([row["confidence"] for row in rows])
    seconds = [row["seconds"] for row in rows]
    return [
        name,
        len(rows),
        f"{right.mean():.1%}",
        f"{(accepted & ~right).mean():.1%}",
        f"{(~accepted & right).sum() / max(right.sum(), 1):.1%}",
        round(roc_area(confidence, right), 3) if 0 < right.sum() < len(right) else "-",
        float(np.median(seconds)),
        float(np.quantile(seconds, 0.95)),
    ]


SCENES_EXPERIMENT = Experiment("scenes", "Scenes of other families", run, table)
