"""Poses beside each other: which differ, by how much the best one leads, which fit as well."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.assess.confidence import CONTRAST_OF_LEAD, MAX_CONTRAST, MIN_COVERAGE, Evidence
from mpe_core.refine.minimum import Minimum
from mpe_core.search.pose_search import are_close, distinct_rows

AMBIGUITY_MARGIN_AGREEMENT, AMBIGUITY_SHARE_ON_SURFACE = 0.05, 0.75
"""Surface agreement by which a pose may fall short of the best one, and share of its on-surface
fraction from which on, to fit as well: two views of a carton or of a bare room (docs/tuning.md)."""

AMBIGUITY_SCORE, AMBIGUITY_ON_SURFACE = 1.5, 0.2
"""Score and on-surface fraction by which a pose that would be accepted by itself may fall short of
the best one: of two such poses at least one is wrong (docs/tuning.md)."""

AMBIGUOUS_CONFIDENCE = 0.7
"""Largest confidence of a pose beside others that fit as well: some two thirds of them are right,
whatever else speaks for them (docs/tuning.md)."""


@dataclass(frozen=True, slots=True)
class ScoredPose:
    """Refined pose with the evidence for it."""

    minimum: Minimum
    evidence: Evidence


def select_distinct(ordered: list[ScoredPose]) -> list[ScoredPose]:
    """Select the poses that differ from those before them."""
    poses = np.array([pose.minimum.T for pose in ordered])
    rows = distinct_rows(poses, -np.arange(len(ordered), dtype=np.float32), len(ordered))
    return [ordered[k] for k in rows]


def with_contrast(poses: list[ScoredPose]) -> list[ScoredPose]:
    """Compare each pose with the different ones; those at which nothing meets are no rivals."""
    matrices = np.array([pose.minimum.T for pose in poses])
    scores = np.array([pose.evidence.score for pose in poses])
    on_surface = np.array([pose.evidence.on_surface_fraction for pose in poses])
    meets = np.array([pose.evidence.coverage >= MIN_COVERAGE for pose in poses])
    compared = []
    for row, pose in enumerate(poses):
        rivals = meets & ~are_close(matrices, pose.minimum.T)
        contrast = contrast_with(rivals, row, scores, on_surface)
        evidence = replace(pose.evidence, contrast=contrast, explains_all=False)
        compared.append(replace(pose, evidence=evidence))
    return compared


def contrast_with(
    rivals: NDArray[np.bool_],
    row: int,
    scores: NDArray[np.float64],
    on_surface: NDArray[np.float64],
) -> float:
    """Compute what a pose has over its rivals: its score less their best one.

    Of a pose that scores better than all of them it is at least what its lead stands for, its
    on-surface fraction less their largest one: noise blurs shapes, and with them all scores.

    Parameters
    ----------
    rivals
        (K,) which of the poses differ from it and count.
    row
        Which of the poses it is.
    scores, on_surface
        (K,) scores and on-surface fractions of the poses.
    """
    ahead = scores[row] - scores[rivals].max(initial=-np.inf)
    lead = on_surface[row] - on_surface[rivals].max(initial=0.0)
    contrast = max(ahead, CONTRAST_OF_LEAD * lead) if ahead > 0 else ahead
    return float(min(contrast, MAX_CONTRAST))


def beside_only_complete(pose: ScoredPose, only: ScoredPose) -> ScoredPose:
    """Mark the pose as the only one that explains all, or as one that does not."""
    is_only = are_close(pose.minimum.T, only.minimum.T)
    marked = {"explains_all": True} if is_only else {"contrast": -MAX_CONTRAST}
    return replace(pose, evidence=replace(pose.evidence, **marked))


def select_equal(ordered: list[ScoredPose]) -> list[ScoredPose]:
    """Select the first pose, and those that differ from it but fit as well."""
    best, *others = select_distinct(ordered)
    return [best, *(pose for pose in others if _fits_as_well(pose.evidence, best.evidence))]


def _fits_as_well(other: Evidence, best: Evidence) -> bool:
    """Whether the other pose would be accepted in the absence of the best one, or nearly so.

    The best one has to convince, if only by itself: such rivals may be why it is not accepted.
    """
    if not best.fits or best.explains_all:
        return False
    if (
        other.convinces
        and other.score > best.score - AMBIGUITY_SCORE
        and other.on_surface_fraction > best.on_surface_fraction - AMBIGUITY_ON_SURFACE
    ):
        return True
    return (
        other.surface_agreement > best.surface_agreement - AMBIGUITY_MARGIN_AGREEMENT
        and other.on_surface_fraction > AMBIGUITY_SHARE_ON_SURFACE * best.on_surface_fraction
        and other.score > best.score - MAX_CONTRAST  # free space or layers tell the others apart
    )
