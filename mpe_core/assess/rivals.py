"""Poses beside each other: which differ, by how much the best one leads, which fit as well."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mpe_core.assess.confidence import MAX_CONTRAST, MIN_COVERAGE, Evidence
from mpe_core.refine.minimum import Minimum
from mpe_core.search.pose_search import are_close, distinct_rows

AMBIGUITY_MARGIN_AGREEMENT, AMBIGUITY_SHARE_ON_SURFACE = 0.05, 0.75
"""Surface agreement by which a pose may fall short of the best one, and share of its on-surface
fraction from which on, to fit as well: two views of a carton or of a bare room (docs/tuning.md)."""

AMBIGUITY_SCORE, AMBIGUITY_ON_SURFACE = 1.5, 0.2
"""Score and on-surface fraction by which a pose that would be accepted by itself may fall short of
the best one: of two such poses at least one is wrong (docs/tuning.md)."""


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
    """Compare the score of each pose with that of the best different one.

    Poses at which next to nothing meets are no rivals.
    """
    ordered = sorted(poses, key=lambda pose: pose.evidence.score, reverse=True)
    best, *others = select_distinct(ordered)
    distinct = [best, *(pose for pose in others if pose.evidence.coverage >= MIN_COVERAGE)]
    second = distinct[1].evidence.score if len(distinct) > 1 else -np.inf
    return [
        replace(
            pose,
            evidence=replace(
                pose.evidence, contrast=_contrast(pose, best, second), explains_all=False
            ),
        )
        for pose in poses
    ]


def beside_only_complete(pose: ScoredPose, only: ScoredPose) -> ScoredPose:
    """Mark the pose as the only one that explains all, or as one that does not."""
    is_only = are_close(pose.minimum.T, only.minimum.T)
    marked = {"explains_all": True} if is_only else {"contrast": -MAX_CONTRAST}
    return replace(pose, evidence=replace(pose.evidence, **marked))


def _contrast(pose: ScoredPose, best: ScoredPose, second: float) -> float:
    """Score of the pose less that of the best pose, or of the second if it is that itself."""
    is_best = are_close(pose.minimum.T, best.minimum.T)
    rival = second if is_best else best.evidence.score
    return float(min(pose.evidence.score - rival, MAX_CONTRAST))


def select_equal(ordered: list[ScoredPose]) -> list[ScoredPose]:
    """Select the first pose, and those that differ from it but fit as well."""
    best, *others = select_distinct(ordered)
    return [best, *(pose for pose in others if _fits_as_well(pose.evidence, best.evidence))]


def _fits_as_well(other: Evidence, best: Evidence) -> bool:
    """Whether the other pose would be accepted in the absence of the best one, or nearly so."""
    if not best.accepted or best.explains_all:
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
    )
