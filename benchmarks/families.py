"""The models of the confidence, fitted over families of scenes, and tested on a family left out.

Cases are real pairs, pairs of generated worlds, and pairs that no pose registers: of two worlds of
one kind, or of two suites. Each has several refined poses, among them the minimum next to the true
pose. A first model scores each pose by itself; a second one tells from the score of the best pose,
and from what it has over the different ones, whether it is right.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from benchmarks.confidence import roc_area
from benchmarks.experiment import DATA, Experiment, Result, markdown
from benchmarks.impossible import impossible_pairs
from benchmarks.recall import is_right
from benchmarks.scenes import SCENES, viewpoint_options
from benchmarks.worlds.pairs import WorldPair, foreign_pairs, world_pairs
from mpe_core import RegistrationOptions
from mpe_core.assess.confidence import (
    CONVINCING_LAYER_SUPPORT,
    ENOUGH_COVERAGE,
    MIN_COVERAGE,
    Evidence,
)
from mpe_core.assess.rivals import ScoredPose, contrast_with
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import inverse
from mpe_core.pipeline import PosePipeline
from mpe_core.refine.minimum import Minimum
from mpe_core.rigid_registration import MIN_EXCHANGE_RATIO, prepare_pair
from mpe_core.search.levelled_effort import THOROUGH_LEVELLED
from mpe_core.search.pose_prior import PosePrior
from mpe_core.search.pose_search import QUICK, THOROUGH, are_close
from tests.factories.checks import pose_error
from tests.factories.clouds import Array, Pair, real_trial

WORLDS, FOREIGN, IMPOSSIBLE, EVERY_SHARED = 4, 3, 30, 2
"""Pairs of each family of worlds and of two worlds of one family, impossible pairs of suites, and
which of the shared pairs are taken."""

FIRST_WORLD, SEED = 100, 1
WRONG_COUNTS = 2.0
ROUNDS = 5
"""Rounds in which the wrong poses with the highest scores take over the fit."""

RIDGE, RIDGE_OF_BEST = 0.003, 0.01
IMPOSSIBLE_FAMILIES = 3

WITHOUT = {
    "all evidence": (),
    "without shape": ("shape",),
    "without contrast": ("contrast",),
    "without lead": ("lead",),
    "without layers": ("layers",),
    "without free space": ("violation",),
    "agreement and coverage alone": ("shape", "contrast", "layers", "violation"),
}
"""Ablations: names of the evidence that is left out; without contrast no rivals are looked at, and
without lead their scores alone are."""

NAMES = ("agreement", "small coverage", "shape", "violation", "layers")


@dataclass(frozen=True)
class Case:
    """Two clouds, and what is known of their pose."""

    name: str
    family: str
    source: Array
    target: Array
    truth: Array | None
    """(4, 4) true pose; None if there is none."""
    tolerance: Pair
    viewpoints: RegistrationOptions | None
    """Options with both viewpoints, where they are known."""


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    rows = [row for case in _cases() for row in _rows(case)]
    return {"rows": rows}


def _cases() -> Iterator[Case]:
    for root, step in ((SCENES, 1), (DATA, EVERY_SHARED)):
        for pair in json.loads((root / "pairs.json").read_text())[::step]:
            trial = real_trial(root, pair, seed=SEED)
            known = viewpoint_options(pair, trial) if pair.get("viewpoints") else None
            yield Case(
                pair["id"],
                pair["suite"],
                trial.source,
                trial.target,
                trial.T_target_source,
                pair,
                known,
            )
    for world in (*world_pairs(WORLDS, FIRST_WORLD), *foreign_pairs(FOREIGN, FIRST_WORLD)):
        yield _case_of(world)
    for number, (name, source, target) in enumerate(impossible_pairs(IMPOSSIBLE)):
        family = f"other suites {number % IMPOSSIBLE_FAMILIES}"
        yield Case(name, family, source, target, None, {}, None)


def _case_of(pair: WorldPair) -> Case:
    return Case(
        pair.name,
        pair.family,
        pair.source,
        pair.target,
        pair.T_target_source,
        pair.tolerance(),
        pair.viewpoint_options(),
    )


def _rows(case: Case) -> Iterator[Result]:
    """Yield what is measured of each pose, without viewpoints and with those that are known."""
    options = RegistrationOptions()
    source, target = validate_cloud(case.source), validate_cloud(case.target)
    for known in (options, case.viewpoints):
        if known is None:
            continue
        pair, clouds = prepare_pair(source, target, known)
        is_exchanged = np.divide(*pair.radii) >= MIN_EXCHANGE_RATIO
        moved, fixed = reversed(clouds) if is_exchanged else clouds
        exchanged = inverse if is_exchanged else np.copy
        pipeline = PosePipeline(moved, fixed, PosePrior(), known, pair.size_ratio)
        if known is options:
            truth = None if case.truth is None else exchanged(pair.from_caller(case.truth))
            found = [pair.to_caller(exchanged(p.minimum.T)) for p in _poses(pipeline, truth)]
        right = [_is_right(case, T) for T in found]
        scored = []
        for T in found:
            at = exchanged(pair.from_caller(T))
            scored.append(ScoredPose(Minimum(at, True, 0), pipeline.score(at)))
        for pose, correct in zip(pipeline.compare(scored), right, strict=True):
            evidence = asdict(pose.evidence)
            yield {
                "case": case.name,
                "family": case.family,
                "possible": case.truth is not None,
                "right": correct,
                "T": np.round(pose.minimum.T[:3], 3).tolist(),
                **{key: evidence[key] for key in KEPT},
            }


KEPT = (
    "coverage",
    "on_surface_fraction",
    "surface_agreement",
    "shape_correlation",
    "free_space_violation",
    "layer_support",
)


def _poses(pipeline: PosePipeline, truth: Array | None) -> list[ScoredPose]:
    """Refined candidates of two levels and of the levelled search, and that next to the truth."""

    def ignore(_: float) -> None:
        pass

    coarse = [T for level in (QUICK, THOROUGH) for T in pipeline.search.find(level, ignore).poses]
    levelled = pipeline.judge.levelled
    if levelled is not None:
        found = pipeline.search.find_levelled(levelled, THOROUGH_LEVELLED, ignore)
        coarse += list(found.poses[:8])
    if truth is not None:
        coarse.append(truth)
    poses = [pipeline.refine(T) for T in coarse]
    best = max(poses, key=lambda pose: pose.evidence.sort_key)
    turned = pipeline.search.find_turned(best.minimum.T, ignore).poses
    return [*poses, *(pipeline.refine(T) for T in turned)]


def _is_right(case: Case, T: Array) -> bool:
    if case.truth is None:
        return False
    return is_right(case.tolerance, *pose_error(T, case.truth, case.source))


@dataclass(frozen=True)
class Poses:
    """The poses of a case, as the models see them."""

    family: str
    possible: bool
    X: Array
    """(K, 5) evidence, as in NAMES."""
    on_surface: Array
    """(K,) on-surface fractions; zeros where the lead is left out."""
    right: NDArray[np.bool_]
    apart: NDArray[np.bool_]
    """(K, K) whether two poses differ."""


def poses_of(rows: Sequence[Result], *, seen: bool, without: Sequence[str] = ()) -> list[Poses]:
    """Gather the rows of each case, with viewpoints or without; noise hides no shape in them."""
    columns = [name in without for name in NAMES]
    gathered = []
    for mine in _cases_of(rows, seen=seen, has_shape=True):
        X = np.array([_features(row) for row in mine])
        X[:, columns] = 0.0
        T = np.array([row["T"] for row in mine])
        apart = np.array([~are_close(T, each) for each in T])
        right = np.array([row["right"] for row in mine])
        on_surface = np.array([row["on_surface_fraction"] for row in mine])
        if "lead" in without:
            on_surface[:] = 0.0
        gathered.append(Poses(mine[0]["family"], mine[0]["possible"], X, on_surface, right, apart))
    return gathered


def _cases_of(rows: Sequence[Result], *, seen: bool, has_shape: bool) -> list[list[Result]]:
    """Rows of each case, with viewpoints or without, whose shape tells or is hidden."""
    cases: dict[str, list[Result]] = {}
    for row in rows:
        if (row["shape_correlation"] is not None) == has_shape and seen == (
            row["free_space_violation"] is not None
        ):
            cases.setdefault(row["case"], []).append(row)
    return list(cases.values())


def _features(row: Result) -> list[float]:
    small = np.clip(row["coverage"], MIN_COVERAGE, ENOUGH_COVERAGE) / ENOUGH_COVERAGE
    support = row["layer_support"]
    lack = 0.0 if support is None else max(0.0, CONVINCING_LAYER_SUPPORT - support)
    violation = row["free_space_violation"] or 0.0
    return [
        row["surface_agreement"],
        float(np.log(small)),
        row["shape_correlation"],
        violation,
        lack,
    ]


@dataclass(frozen=True)
class Fit:
    """Both models."""

    score: Array
    """(6,) weights of NAMES, and intercept."""
    best: Array
    """(3,) weights of score and contrast, and intercept."""

    def judge(self, poses: Poses, *, contrast: bool) -> tuple[int, float]:
        """Row of the best pose, and its log odds."""
        score = poses.X @ self.score[:-1] + self.score[-1]
        row = int(np.argmax(score))
        if not contrast:
            return row, float(score[row])
        return row, float(_of_best(poses, score, row) @ self.best[:-1] + self.best[-1])


def fit(cases: Sequence[Poses]) -> Fit:
    """Fit both models; of each case, the wrong poses with the highest scores count most."""
    score: Array | None = None
    for _ in range(ROUNDS):
        X, right, weight = [], [], []
        for case in cases:
            for kind, count in ((True, 1.0), (False, WRONG_COUNTS)):
                rows = np.flatnonzero(case.right == kind)
                if not len(rows):
                    continue
                share = np.ones(len(rows))
                if score is not None:
                    reached = case.X[rows] @ score[:-1]
                    share = np.exp(2 * (reached - reached.max()))
                X.append(case.X[rows])
                right.append(case.right[rows])
                weight.append(count * share / share.sum())
        score = logistic(np.vstack(X), np.concatenate(right), np.concatenate(weight), RIDGE)
    best, is_right = [], []
    for case in cases:
        reached = case.X @ score[:-1] + score[-1]
        row = int(np.argmax(reached))
        best.append(_of_best(case, reached, row))
        is_right.append(case.right[row])
    flags = np.array(is_right)
    weight_of = np.where(flags, 1.0, WRONG_COUNTS)
    return Fit(score, logistic(np.array(best), flags, weight_of, RIDGE_OF_BEST))


def _of_best(poses: Poses, score: Array, row: int) -> Array:
    """(2,) score of the best pose, and its contrast."""
    return np.array([score[row], contrast_with(poses.apart[row], row, score, poses.on_surface)])


def logistic(X: Array, right: NDArray[np.bool_], weight: Array, ridge: float) -> Array:
    """(M + 1,) weights and intercept of the logistic model of rows (N, M)."""

    def loss(b: Array) -> float:
        logit = X @ b[:-1] + b[-1]
        misfit = (weight * np.logaddexp(0, np.where(right, -logit, logit))).sum()
        return float(misfit + ridge * np.square(b[:-1]).sum())

    fitted: Array = minimize(loss, np.zeros(X.shape[1] + 1)).x
    return fitted


def left_out(cases: Sequence[Poses], *, contrast: bool = True) -> list[Result]:
    """Judge the cases of each family by models that were fitted to the others."""
    judged = []
    for family in dict.fromkeys(case.family for case in cases):
        model = fit([case for case in cases if case.family != family])
        for case in cases:
            if case.family == family:
                row, odds = model.judge(case, contrast=contrast)
                right = bool(case.right[row])
                judged.append(
                    {"family": family, "possible": case.possible, "right": right, "odds": odds}
                )
    return judged


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    parts = [
        "Poses of real scenes, shared pairs, generated worlds and pairs that no pose registers:"
        " refined candidates of the search, and the minimum next to the true pose. The best pose of"
        " each case is judged by models that were fitted to the cases of all other families;"
        f" a wrong pose counts {WRONG_COUNTS:g} times. The worlds and all real pairs"
        " were in view when the kinds of evidence were chosen.\n"
    ]
    for seen, title in ((False, "Without viewpoints"), (True, "With viewpoints")):
        cases = poses_of(result["rows"], seen=seen)
        model = fit(cases)
        weights = ", ".join(
            f"{name} {weight:.2f}"
            for name, weight in zip((*NAMES, "intercept"), model.score, strict=True)
        )
        best = ", ".join(f"{value:.2f}" for value in model.best)
        parts.append(
            f"## {title}\n\nFitted to all: {weights}; the best pose by score, contrast and"
            f" intercept: {best}.\n\n"
            + markdown(COLUMNS, [_ablation(result["rows"], seen, name) for name in WITHOUT])
            + "\n\n### Each family left out\n\n"
            + markdown(COLUMNS, _by_family(left_out(cases)))
            + "\n\n### Reliability\n\n"
            + markdown(("confidence", "poses", "right"), reliability(left_out(cases)))
        )
    parts.append(
        "## Where the shape is hidden\n\nBy noise, in one plane, or by few points; judged by the"
        " models in use for these, whose score was fitted to half of the shared pairs with noise"
        " ([calibration](calibration.md)), and whose contrast to other pairs and worlds"
        " ([hidden shape](hidden_shape.md)). One plane on another counts as wrong here; the"
        " result refuses it, since it slides in two directions.\n\n"
        + markdown(COLUMNS, _where_shape_is_hidden(result["rows"]))
    )
    return "\n\n".join(parts)


def _where_shape_is_hidden(rows: Sequence[Result]) -> list[list[object]]:
    """Judge the cases whose shape is hidden by the models in use for these."""
    lines = []
    for seen, name in ((False, "without viewpoints"), (True, "with viewpoints")):
        judged = []
        for mine in _cases_of(rows, seen=seen, has_shape=False):
            scores = np.array([_evidence(row).score for row in mine])
            on_surface = np.array([row["on_surface_fraction"] for row in mine])
            T, row = np.array([row["T"] for row in mine]), int(np.argmax(scores))
            contrast = contrast_with(~are_close(T, T[row]), row, scores, on_surface)
            judged.append(
                {
                    "possible": mine[0]["possible"],
                    "right": bool(mine[row]["right"]),
                    "odds": replace(_evidence(mine[row]), contrast=contrast).log_odds,
                }
            )
        lines.append(verdicts(name, judged))
    return lines


def _evidence(row: Result) -> Evidence:
    measured = {key: row[key] for key in KEPT}
    return Evidence(**measured)


COLUMNS = ("", "cases", "right", "wrong accepted", "right refused", "area under ROC")
BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0)


def _ablation(rows: Sequence[Result], seen: bool, name: str) -> list[object]:
    cases = poses_of(rows, seen=seen, without=WITHOUT[name])
    return verdicts(name, left_out(cases, contrast="contrast" not in WITHOUT[name]))


def _by_family(judged: Sequence[Result]) -> list[list[object]]:
    families = dict.fromkeys(row["family"] for row in judged)
    return [verdicts(name, [row for row in judged if row["family"] == name]) for name in families]


def verdicts(name: str, judged: Sequence[Result]) -> list[object]:
    """Line of a table under COLUMNS, of best poses with their log odds."""
    right = np.array([row["right"] for row in judged])
    odds = np.array([row["odds"] for row in judged])
    possible = sum(row["possible"] for row in judged)
    both = right.any() and not right.all()
    return [
        name,
        len(judged),
        f"{right.sum()}/{possible}",
        int(((odds > 0) & ~right).sum()),
        int(((odds <= 0) & right).sum()),
        round(roc_area(odds, right), 3) if both else "-",
    ]


def reliability(judged: Sequence[Result]) -> list[list[object]]:
    """Lines of a table: confidences, best poses that have them, and the share that is right."""
    confidence = np.array([1 / (1 + np.exp(-row["odds"])) for row in judged])
    right = np.array([row["right"] for row in judged])
    lines: list[list[object]] = []
    for low, high in pairwise(BINS):
        mine = (confidence >= low) & (confidence < high + (high == 1))
        share = f"{right[mine].mean():.0%}" if mine.any() else "-"
        lines.append([f"{low:g} to {high:g}", int(mine.sum()), share])
    return lines


FAMILIES_EXPERIMENT = Experiment(
    "families", "The confidence on families that were left out", run, table
)
