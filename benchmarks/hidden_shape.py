"""The confidence of the best of several poses where noise or flat sides hide the shape.

By itself such a pose tells little: flat sides lie on each other at many poses, and under noise all
surfaces look alike. What it has over the different ones tells more.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.calibration import CLEAN, NOISES, SLACK, noisy
from benchmarks.experiment import DATA, Experiment, Result, markdown
from benchmarks.families import (
    COLUMNS,
    IMPOSSIBLE_FAMILIES,
    RIDGE_OF_BEST,
    WRONG_COUNTS,
    logistic,
    reliability,
    verdicts,
)
from benchmarks.impossible import impossible_pairs
from benchmarks.recall import is_right
from benchmarks.worlds.families import FAMILIES
from benchmarks.worlds.pairs import WorldPair, foreign_pair, world_pair
from mpe_core import RegistrationOptions
from mpe_core.assess.confidence import MAX_CONTRAST, Evidence
from mpe_core.clouds.validate import validate_cloud
from mpe_core.progress import Progress
from mpe_core.rigid_registration import register_rigidly
from tests.factories.checks import pose_error
from tests.factories.clouds import Array, Pair, real_trial

FIRST_WORLD, WORLDS, FLAT_WORLDS = 200, 3, 12
"""Number of the first world, pairs of each family with noise, and of those with flat sides."""

FLAT = ("cartons", "room_frames")
"""Families whose sides are flat enough to hide the shape without noise."""

IMPOSSIBLE = 120


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    rows = [*_real(), *_impossible(), *_worlds()]
    return {"rows": rows, "fitted": fit(rows)}


def _real() -> Iterator[Result]:
    """Yield the pose found of each shared pair with noise."""
    rng = np.random.default_rng(2)
    for pair in json.loads((DATA / "pairs.json").read_text()):
        trial = real_trial(DATA, pair, seed=0)
        for noise in NOISES:
            x, y = noisy(trial.source, trial.target, noise, rng)
            truth = trial.T_target_source
            yield from _found(pair["id"], pair["suite"], x, y, truth, pair, RegistrationOptions())


def _impossible() -> Iterator[Result]:
    """Yield the pose found of pairs of suites that show something else, with noise."""
    rng = np.random.default_rng(3)
    for number, (name, source, target) in enumerate(impossible_pairs(IMPOSSIBLE)):
        x, y = noisy(source, target, NOISES[number % len(NOISES)], rng)
        family = f"other suites {number % IMPOSSIBLE_FAMILIES}"
        yield from _found(name, family, x, y, None, {}, RegistrationOptions())


def _worlds() -> Iterator[Result]:
    """Yield the pose found of generated worlds, with noise and, if their sides are flat, without.

    With the scanners' places, where there are any, and without.
    """
    rng = np.random.default_rng(4)
    for draw in (world_pair, foreign_pair):
        for place, family in enumerate(FAMILIES):
            for number in range(WORLDS):
                noise = NOISES[(place + number) % len(NOISES)]
                yield from _found_in(draw(family, FIRST_WORLD + number), noise, rng)
        for family in FLAT:
            for number in range(FLAT_WORLDS):
                yield from _found_in(draw(family, FIRST_WORLD + number), CLEAN, rng)


def _found_in(
    world: WorldPair, noise: tuple[float, float], rng: np.random.Generator
) -> Iterator[Result]:
    tolerance = world.tolerance()
    x, y = noisy(world.source, world.target, noise, rng)
    truth, blind = world.T_target_source, RegistrationOptions(infer_viewpoints="never")
    for options in (blind, world.viewpoint_options()):
        if options is not None:
            yield from _found(world.name, world.family, x, y, truth, tolerance, options)


def _found(
    case: str,
    family: str,
    source: Array,
    target: Array,
    truth: Array | None,
    tolerance: Pair,
    options: RegistrationOptions,
) -> Iterator[Result]:
    """Yield what speaks for the pose that is found, if the shape is hidden."""
    clouds = validate_cloud(source), validate_cloud(target)
    found = register_rigidly(*clouds, options, Progress(None))
    evidence = found.best.evidence
    if not isinstance(evidence, Evidence) or evidence.shape_correlation is not None:
        return
    contrast = MAX_CONTRAST if evidence.contrast is None else evidence.contrast
    yield {
        "case": case,
        "family": family,
        "seen": evidence.free_space_violation is not None,
        "possible": truth is not None,
        "right": truth is not None and _is_right(tolerance, found.T_target_source, truth, source),
        "score": evidence.score,
        "contrast": MAX_CONTRAST if evidence.explains_all else contrast,
        "fits_whole": evidence.fits_whole,
        "slides": len(found.found.free_directions),
        "ambiguous": found.found.ambiguous,
    }


def _is_right(tolerance: Pair, T: Array, truth: Array, source: Array) -> bool:
    """Whether a pose is as near as noise lets it come."""
    degrees, shift = pose_error(T, truth, source)
    return is_right(tolerance, degrees / SLACK, shift / SLACK)


def fit(rows: Sequence[Result]) -> list[float]:
    """Weights of score and contrast, and intercept, of a logistic model of the rows."""
    X = np.array([[row["score"], row["contrast"]] for row in rows])
    right = np.array([row["right"] for row in rows])
    weight = np.where(right, 1.0, WRONG_COUNTS)
    return [round(float(value), 2) for value in logistic(X, right, weight, RIDGE_OF_BEST)]


def _left_out(rows: Sequence[Result]) -> list[Result]:
    """Judge the rows of each family by the model of the others."""
    judged = []
    for family in dict.fromkeys(row["family"] for row in rows):
        model = fit([row for row in rows if row["family"] != family])
        judged += [
            row | {"odds": model[0] * row["score"] + model[1] * row["contrast"] + model[2]}
            for row in rows
            if row["family"] == family
        ]
    return judged


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    rows = result["rows"]
    judged = _left_out(rows)
    alone = [row | {"odds": row["score"]} for row in rows]
    score, contrast, intercept = result["fitted"]
    groups = {
        "without viewpoints": [row for row in judged if not row["seen"]],
        "with viewpoints": [row for row in judged if row["seen"]],
    }
    families = {
        name: [row for row in judged if row["family"] == name]
        for name in dict.fromkeys(row["family"] for row in judged)
    }
    return (
        f"What `register` finds of the shared pairs and {IMPOSSIBLE} impossible ones with noise of"
        " 0.006 to 0.02 radii in one cloud or both, of generated worlds with that noise, and of"
        f" {' and '.join(FLAT)} without, wherever the surface variation tells no shape. A pose"
        f" within {SLACK:g} times the tolerances is right. The worlds are not those of other pages."
        " The score is the log odds of a pose by itself. A logistic model of score and contrast,"
        f" fitted to all, a wrong pose counting {WRONG_COUNTS:g} times: {score} times the score,"
        f" {contrast} times the contrast, {intercept}.\n\n"
        + markdown(
            COLUMNS,
            [
                verdicts("score alone", alone),
                verdicts("score and contrast, each family left out", judged),
                *(verdicts(f"of these {name}", mine) for name, mine in groups.items()),
            ],
        )
        + "\n\n### Each family left out\n\n"
        + markdown(COLUMNS, [verdicts(name, mine) for name, mine in families.items()])
        + "\n\n### Reliability\n\n"
        + markdown(("confidence", "poses", "right"), reliability(judged))
    )


HIDDEN_SHAPE = Experiment("hidden_shape", "The confidence where the shape is hidden", run, table)
