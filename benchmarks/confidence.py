"""How well the confidence tells right poses from wrong ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.stats import rankdata

from benchmarks.comparison import binned
from benchmarks.experiment import DATA, Experiment, Result, markdown
from benchmarks.impossible import impossible_pairs
from benchmarks.recall import is_right
from benchmarks.symmetric import SHAPES
from mpe_core import Registration, RegistrationOptions, register
from mpe_core.clouds.normalize import CloudPair as Centred
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.preprocess import prepare_clouds
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import apply
from mpe_core.pipeline import PosePipeline
from mpe_core.search.pose_prior import PosePrior
from tests.factories.checks import pose_error
from tests.factories.clouds import Array, Pair, moved, real_trial

SEEDS = 3
IMPOSSIBLE = 120
BINS = (0.0, 0.02, 0.1, 0.5, 0.9, 0.98, 1.0)
FITTING = 1.5  # times the median distance at the true pose: a shape lies on itself


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    return {"rows": _real() + _foreign(), "shapes": [_shape(shape) for shape in SHAPES]}


def _real() -> list[Result]:
    rows = []
    for number, pair in enumerate(json.loads((DATA / "pairs.json").read_text())):
        for seed in range(SEEDS):
            labels = {"case": pair["id"], "kind": "real", "half": number % 2, "seed": seed}
            rows.append(labels | judged_attempt(pair, seed))
    return rows


def judged_attempt(pair: Pair, seed: int) -> Result:
    """Whether the pose of a pair is right, its errors, and `_judged`."""
    trial = real_trial(DATA, pair, seed=seed)
    found = register(trial.source, trial.target)
    degrees, shift = pose_error(found.T_target_source, trial.T_target_source, trial.source)
    errors = {"right": is_right(pair, degrees, shift), "degrees": degrees, "shift": shift}
    return errors | _judged(trial.source, trial.target, found)


def _foreign() -> list[Result]:
    rows = []
    for number, (name, source, target) in enumerate(impossible_pairs(IMPOSSIBLE)):
        labels = {"case": name, "kind": "impossible", "half": number % 2, "right": False}
        rows.append(labels | _judged(source, target, register(source, target)))
    return rows


def _judged(source: Array, target: Array, found: Registration) -> Result:
    """Confidence and verdict, and the evidence that they come from."""
    pair, pipeline = pipeline_of(source, target)
    T = pair.from_caller(found.T_target_source)
    return {
        "confidence": found.confidence,
        "accepted": found.accepted,
        "ambiguous": found.ambiguous,
        **asdict(pipeline.score(T)),
    }


def pipeline_of(source: Array, target: Array) -> tuple[Centred, PosePipeline]:
    """Return the normalized clouds and the pipeline that `register` runs with its defaults."""
    pair = normalize_pair(validate_cloud(source), validate_cloud(target))
    options = RegistrationOptions()
    clouds = prepare_clouds(pair, options)
    return pair, PosePipeline(*clouds, PosePrior(), options, pair.size_ratio)


def _shape(shape: Callable[[np.random.Generator], Array]) -> Result:
    rng = np.random.default_rng(0)
    target, trial = shape(rng), moved(shape(rng), rng, largest_deg=180)
    found, tree = register(trial.source, target), KDTree(target)
    gap, least = (
        np.median(tree.query(apply(T, trial.source))[0])
        for T in (found.T_target_source, trial.T_target_source)
    )
    return {
        "shape": shape.__name__,
        "fits": bool(gap < FITTING * least),
        "confidence": found.confidence,
        "accepted": found.accepted,
        "ambiguous": found.ambiguous,
        "others": len(found.alternatives),
    }


def roc_area(score: NDArray[np.float64], right: NDArray[np.bool_]) -> float:
    """Chance that a right one scores above a wrong one, equal scores counting half."""
    places = rankdata(score)[right].sum() - right.sum() * (right.sum() + 1) / 2
    return float(places / (right.sum() * (~right).sum()))


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    rows = result["rows"]
    shapes = [
        (s["shape"], s["fits"], s["accepted"], s["ambiguous"], s["others"])
        for s in result["shapes"]
    ]
    return (
        f"Every pair of pairs.json from {SEEDS} starts, right by the tolerances of the pair, and "
        f"{IMPOSSIBLE} impossible pairs: the source is of another suite that shows something else, "
        "scaled to the size of the target. The model of the confidence may be fitted to the cases "
        "of half 0 (every other pair, every other impossible one, and these with noise), never to "
        "those of half 1.\n\n"
        + verdicts_table(
            {
                "all": rows,
                "half 0": [r for r in rows if r["half"] == 0],
                "half 1": [r for r in rows if r["half"] == 1],
                "real pairs": [r for r in rows if r["kind"] == "real"],
                "impossible": [r for r in rows if r["kind"] == "impossible"],
            }
        )
        + "\n\nReliability: how many of the poses with this confidence are right.\n\n"
        + markdown(("confidence", "poses", "mean confidence", "right"), _reliability(rows))
        + f"\n\n{misjudged(rows)}\n\nShapes that fit on themselves in several ways:\n\n"
        + markdown(("shape", "pose fits", "accepted", "ambiguous", "alternatives"), shapes)
    )


def verdicts_table(groups: dict[str, list[Result]]) -> str:
    """Return a table of how well the verdict tells right from wrong, a row for each group."""
    return markdown(
        ("cases", "right", "wrong", "area under ROC", "wrong accepted", "right refused"),
        [_summary(name, rows) for name, rows in groups.items()],
    )


def misjudged(rows: list[Result]) -> str:
    """List the cases whose verdict is wrong."""
    accepted = [r for r in rows if r["accepted"] and not r["right"]]
    refused = [r for r in rows if r["right"] and not r["accepted"]]
    return f"Wrong, but accepted: {_named(accepted)}.\n\nRight, but refused: {_named(refused)}."


def _summary(name: str, rows: list[Result]) -> tuple[object, ...]:
    right = _right(rows)
    taken = np.array([r["accepted"] for r in rows])
    both = right.any() and not right.all()
    return (
        name,
        int(right.sum()),
        int((~right).sum()),
        f"{roc_area(np.array([r['confidence'] for r in rows]), right):.4f}" if both else "-",
        _share(taken[~right]),
        _share(~taken[right]),
    )


def _share(chosen: NDArray[np.bool_]) -> str:
    return f"{chosen.sum()}/{len(chosen)} ({chosen.mean():.1%})" if len(chosen) else "-"


def _reliability(rows: list[Result]) -> list[tuple[object, ...]]:
    return [
        (f"{low:g} to {high:g}", len(mine), _mean(mine, "confidence"), _share(_right(mine)))
        for low, high, mine in binned(rows, "confidence", BINS)
    ]


def _mean(rows: list[Result], key: str) -> float:
    return float(np.mean([r[key] for r in rows]))


def _right(rows: list[Result]) -> NDArray[np.bool_]:
    return np.array([r["right"] for r in rows])


def _named(rows: list[Result]) -> str:
    names = [
        f"{r['case']} ({r['confidence']:.2f}" + (f", start {r['seed']})" if "seed" in r else ")")
        for r in rows
    ]
    return "; ".join(names) or "none"


def draw(result: Result, figure: Figure) -> None:
    """Evidence of right and wrong poses, the ROC curve, and how far the confidence is true."""
    evidence, curve, reliability = figure.subplots(1, 3)
    rows = result["rows"]
    for right, color in ((True, "tab:blue"), (False, "tab:red")):
        mine = [r for r in rows if r["right"] == right]
        agreement, coverage = ([r[key] for r in mine] for key in ("surface_agreement", "coverage"))
        evidence.plot(
            agreement, coverage, ".", color=color, alpha=0.5, label="right" if right else "wrong"
        )
    evidence.set(xlabel="on the target, of those over it", ylabel="share of near points")
    evidence.legend()
    ordered = _right(sorted(rows, key=lambda r: -r["confidence"]))
    curve.plot(np.cumsum(~ordered) / (~ordered).sum(), np.cumsum(ordered) / ordered.sum())
    curve.set(xlabel="wrong poses accepted", ylabel="right ones accepted")
    bins = [mine for _, _, mine in binned(rows, "confidence", BINS)]
    reliability.plot([0, 1], [0, 1], ":", color="grey")
    reliability.plot(
        *np.transpose([[_mean(b, k) for k in ("confidence", "right")] for b in bins]), "o"
    )
    reliability.set(xlabel="confidence", ylabel="share that is right")


CONFIDENCE = Experiment("confidence", "Knowing when it failed", run, table, draw)
