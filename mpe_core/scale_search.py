"""Registration at the scale that the options allow: one, a change of units, or any."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpe_core.assess.confidence import DOUBTED_CONFIDENCE
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.unit_check import guess_units
from mpe_core.clouds.validate import Cloud
from mpe_core.color_search import SETTLED, settle_by_color
from mpe_core.options import RegistrationOptions
from mpe_core.progress import Progress
from mpe_core.result import CodedWarning, Registration
from mpe_core.rigid_registration import (
    Attempt,
    Trial,
    register_rigidly,
    search_mirrored,
    search_trial,
)
from mpe_core.search.pose_search import QUICK, SEARCH_LEVELS, SearchLevel
from mpe_core.similarity import Similarity, refine_scale

Array = NDArray[np.float64]

QUICK_LEVELS = SEARCH_LEVELS[:2]
"""Levels of the search at a scale that is only tried."""

MIRROR_LEVELS = (replace(QUICK, levelled=None),)
"""Levels of the search with a mirrored source: what is accepted mirrored is found by it, and more
doubles the time of a pair that is not (docs/tuning.md)."""

FREE_RATIOS = (1.0, 0.8, 1.25, 0.64, 1.56)
"""Scales that "free" starts from, over the ratio of the radii; the search bears a tenth."""

GRID_STEP, MAX_GRID = 1.15, 24
"""Ratio between the scales that a range starts from, and their largest number."""

SURE_CONFIDENCE = 0.985
"""Confidence from which on the scale is not doubted: street scans of the right one have 0.996, of
0.93 up to 0.979."""

SURE_HAND_CONFIDENCE = 0.97
"""Confidence from which on the hand is not doubted: rooms that are nearly their own mirror images
are refused otherwise."""

MIN_WRONG_SCALE, MIN_GAIN = 0.03, 1.18
"""Logarithm of the scale next to an accepted pose, and gain of the points on the surface, from
which on the pose is refused (docs/tuning.md)."""

DOUBT_STEP_TOL = 0.001
"""Logarithm of the last step of the scale where only MIN_WRONG_SCALE matters (docs/tuning.md)."""

MIRROR_SCORE = 1.2
"""Score by itself by which a mirrored source has to exceed an accepted pose for that to be refused:
its quick search meets few rivals, so that contrast tells nothing (docs/tuning.md)."""

MIRRORED = CodedWarning(
    "mirrored",
    "the clouds are mirror images: mirrored (x turned to -x), the source fits. Look for a"
    " left-handed or swapped axis in the export of one of them",
)
"""What is said of them."""


def register_scaled(
    source: Cloud, target: Cloud, options: RegistrationOptions, progress: Progress
) -> Registration:
    """Find the pose at the scale of the options.

    Parameters
    ----------
    source, target
        Checked clouds.
    options
        Options of the registration.
    progress
        Takes stages and times.
    """
    if options.scale not in ("fixed", "units"):
        return _register_free(source, target, options, progress)
    if options.scale == "units":
        return _register_units(source, target, options, progress)
    first = settle_by_color(register_rigidly(source, target, options, progress), options, progress)
    if first.is_by_color:
        return _with_cause(first.found, SETTLED)
    if first.found.accepted:
        return _doubt(first, options, progress)
    if first.is_on_plane:
        return first.found  # on one plane any scale and either hand fit
    return _with_cause(first.found, _name_cause(source, target, first, options, progress))


def _register_units(
    source: Cloud, target: Cloud, options: RegistrationOptions, progress: Progress
) -> Registration:
    """Find the units that fit; one unit where none do."""
    for guess in guess_units(*normalize_pair(source, target).radii):
        attempt = _register_at(guess.factor, source, target, options, progress, QUICK_LEVELS)
        if attempt.found.accepted:
            text = CodedWarning(
                "units_changed",
                f"the source is taken to be in {guess.source} and the target in {guess.target}:"
                f" the transform scales by {guess.factor:.6g}",
            )
            return _with_cause(_as_similarity(attempt.found, guess.factor), text)
    return register_rigidly(source, target, options, progress).found


def _doubt(first: Attempt, options: RegistrationOptions, progress: Progress) -> Registration:
    """Refuse an accepted pose where the clouds fit much better at another scale, or mirrored."""
    confidence = first.best.evidence.confidence
    if confidence > SURE_CONFIDENCE or options.method != "mpl":
        return first.found
    cause = _other_scale(first, progress)
    asks_hand = confidence <= SURE_HAND_CONFIDENCE and options.initial_transform is None
    if cause is None and asks_hand:
        cause = _other_hand(first, options, progress)
    if cause is None:
        return first.found
    confidence = min(confidence, DOUBTED_CONFIDENCE)
    return _with_cause(replace(first.found, accepted=False, confidence=confidence), cause)


def _other_scale(first: Attempt, progress: Progress) -> CodedWarning | None:
    """Name the scale at which the clouds fit much better next to an accepted pose."""
    with progress.stage("refine"):
        refined = refine_scale(first, DOUBT_STEP_TOL, MIN_WRONG_SCALE)
    if abs(np.log(refined.factor)) < MIN_WRONG_SCALE:
        return None
    before, after = first.best.evidence, refined.pose.evidence
    gain = after.on_surface_fraction * after.surface_agreement
    if gain < MIN_GAIN * before.on_surface_fraction * before.surface_agreement:
        return None
    return CodedWarning(
        "other_scale",
        f"the clouds fit better with the source scaled by {refined.factor:.4g}: check the scale of"
        ' both, or set scale to "free"',
    )


def _other_hand(
    first: Attempt, options: RegistrationOptions, progress: Progress
) -> CodedWarning | None:
    """Name the other hand where the mirrored source fits clearly better than an accepted pose."""
    before = first.best.evidence
    least_score = before.score + MIRROR_SCORE
    after = _search_mirrored(first, options, progress, least_score).best.evidence
    is_better = after.sort_key > before.sort_key
    return MIRRORED if is_better and after.score > least_score else None


def _name_cause(
    source: Cloud, target: Cloud, first: Attempt, options: RegistrationOptions, progress: Progress
) -> CodedWarning | None:
    """Name what would make a refused pair fit: other units, or the other hand."""
    if options.initial_transform is not None or options.method != "mpl":
        return None
    for guess in guess_units(*first.pair.radii):
        trial = search_trial(
            source.scaled(guess.factor),
            target,
            _at_scale(options, guess.factor),
            progress,
            QUICK_LEVELS,
        )
        if trial.best.evidence.accepted:
            larger = max(guess.factor, 1 / guess.factor)
            names = ("target", "source") if guess.factor > 1 else ("source", "target")
            return CodedWarning(
                "other_units",
                f"the {names[0]} is {larger:.6g} times as large as the {names[1]}: they fit with"
                f" the source in {guess.source} and the target in {guess.target}. Convert both to"
                ' one unit, or set scale to "units"',
            )
    mirrored = _search_mirrored(first, options, progress).best.evidence
    explains_more = mirrored.on_surface_fraction > first.best.evidence.on_surface_fraction
    return MIRRORED if mirrored.accepted and explains_more else None


def _register_at(
    scale: float,
    source: Cloud,
    target: Cloud,
    options: RegistrationOptions,
    progress: Progress,
    levels: Sequence[SearchLevel] = SEARCH_LEVELS,
    start: Array | None = None,
) -> Attempt:
    """Register the source with its coordinates times a scale."""
    options = _at_scale(options, scale)
    return register_rigidly(
        source.scaled(scale), target, options, progress, levels=levels, start=start
    )


def _at_scale(options: RegistrationOptions, scale: float) -> RegistrationOptions:
    """Options with the viewpoints of the source times a scale."""
    if options.source_viewpoint is None:
        return options
    scaled: Any = np.multiply(options.source_viewpoint, scale)
    return replace(options, source_viewpoint=scaled)


def _search_mirrored(
    first: Trial, options: RegistrationOptions, progress: Progress, least_score: float = -np.inf
) -> Trial:
    """Search with the source's x turned to -x, and what the caller knows of it."""
    g = options.source_gravity
    gravity = None if g is None else (-g[0], g[1], g[2])
    options = replace(options, source_gravity=gravity)
    return search_mirrored(first, options, progress, MIRROR_LEVELS, least_score)


def _register_free(
    source: Cloud, target: Cloud, options: RegistrationOptions, progress: Progress
) -> Registration:
    """Try scales within the bounds, and refine the best."""
    tried: list[tuple[float, Similarity]] = []
    for start in _start_scales(source, target, options.scale):
        attempt = _register_at(start, source, target, options, progress, QUICK_LEVELS[:1])
        with progress.stage("refine"):
            refined = refine_scale(attempt)
        is_better = refined.pose.evidence.accepted
        tried.append((start, refined if is_better else Similarity(attempt, attempt.best)))
        if refined.pose.evidence.confidence > SEARCH_LEVELS[0].stop_confidence:
            break
    bounds = options.scale if isinstance(options.scale, tuple) else (0.0, np.inf)
    allowed = [
        (start, each) for start, each in tried if bounds[0] <= start * each.factor <= bounds[1]
    ]
    start, best = max(allowed or tried, key=lambda each: each[1].pose.evidence.sort_key)
    attempt, scale = best.attempt, start * best.factor
    if best.factor != 1:
        attempt = _register_at(scale, source, target, options, progress, start=best.rigid_pose)
    return _as_similarity(attempt.found, scale, start * best.deviation)


def _as_similarity(found: Registration, scale: float, deviation: float = 0.0) -> Registration:
    """Describe the result of a scaled source as that of the source, by a similarity."""
    S = np.diag([scale] * 3 + [1.0])
    return replace(
        found,
        T_target_source=found.T_target_source @ S,
        alternatives=found.alternatives @ S,
        scale=scale,
        scale_deviation=deviation,
    )


def _start_scales(
    source: Cloud, target: Cloud, scale: str | tuple[float, float]
) -> Sequence[float]:
    ratio = float(target.spread() / source.spread())
    if isinstance(scale, str):
        return [ratio * factor for factor in FREE_RATIOS]
    least, most = scale
    count = int(np.clip(np.ceil(np.log(most / least) / np.log(GRID_STEP)) + 1, 1, MAX_GRID))
    grid = np.geomspace(least, most, count)
    ordered: list[float] = grid[np.argsort(np.abs(np.log(grid / ratio)))].tolist()
    return [ratio, *ordered] if least <= ratio <= most else ordered


def _with_cause(found: Registration, cause: CodedWarning | None) -> Registration:
    return found if cause is None else replace(found, warnings=(*found.warnings, cause))
