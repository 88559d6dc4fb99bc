"""Evidence for a pose, and the confidence that it gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpe_core.options import ACCEPTANCE_THRESHOLD

AGREEMENT_WEIGHT, COVERAGE_WEIGHT, INTERCEPT = 18.6, 6.6, -18.7
"""Logistic model of right against wrong poses, fitted by `python -m benchmarks calibration` to half
of the pairs; a wrong pose counts twice (docs/tuning.md)."""

MAX_FREE_SPACE_VIOLATION, FREE_SPACE_WEIGHT = 0.06, 30.0
"""Violation of free space that drift and thin edges explain, and how much the log odds fall with
what lies beyond it (docs/tuning.md)."""

MAX_LAYER_CONFLICT, LAYER_WEIGHT = 0.25, 20.0
"""Conflict of the layers that occlusion explains, and how much the log odds fall with what lies
beyond it (docs/tuning.md)."""

MAX_CALIBRATED_SIZE_RATIO = 2.0
"""Ratio of the clouds' radii up to which the model holds. Beyond it the odds fall with the number
of places where the smaller cloud fits by chance, ratio ** (2 + degenerate dof) (docs/tuning.md)."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """Measured properties of a pose from which its confidence follows."""

    coverage: float
    """Share of the sample within the reach of the target's planes."""
    on_surface_fraction: float
    """Share of the sample that lies on these planes, with a compatible normal."""
    surface_agreement: float
    """Chance-corrected share of the overlapping points that lie on the target's surface with a
    compatible normal; 0 is no better than chance, 1 is all."""
    overlap: float = 1.0
    """Share of the source that can have a counterpart, as the caller knows it."""
    size_ratio: float = 1.0
    """Radius of the larger cloud over that of the smaller one."""
    free_space_violation: float | None = None
    """Share of the visible points of one scan that stand in what the other one saw through; None
    where the scanners' positions are not known."""
    layer_conflict: float | None = None
    """Share of what one levelled cloud shows over the ground and the other one lacks; None where
    it was not compared."""
    degenerate_dof: int = 0
    """Number of directions in which the surfaces slide on themselves; counted only beyond
    MAX_CALIBRATED_SIZE_RATIO."""

    @property
    def confidence(self) -> float:
        """Probability that the pose is right, in [0, 1]."""
        coverage = min(1.0, self.coverage / self.overlap)
        logit = AGREEMENT_WEIGHT * self.surface_agreement + COVERAGE_WEIGHT * coverage + INTERCEPT
        logit -= self.contradiction
        excess = max(1.0, self.size_ratio / MAX_CALIBRATED_SIZE_RATIO)
        chance_fits = excess ** (2 + self.degenerate_dof)
        return float(1 / (1 + chance_fits * np.exp(-logit)))

    @property
    def contradiction(self) -> float:
        """Fall of the log odds by what the pose contradicts; 0 if it contradicts nothing."""
        violation = max(0.0, (self.free_space_violation or 0.0) - MAX_FREE_SPACE_VIOLATION)
        conflict = max(0.0, (self.layer_conflict or 0.0) - MAX_LAYER_CONFLICT)
        return FREE_SPACE_WEIGHT * violation + LAYER_WEIGHT * conflict

    @property
    def accepted(self) -> bool:
        """Whether the pose is taken for right."""
        return self.confidence >= ACCEPTANCE_THRESHOLD

    @property
    def sort_key(self) -> tuple[bool, float]:
        """Key that is greatest for the best of several poses of a pair.

        The agreement alone does not see that another pose lays more points on the target.
        """
        support = self.on_surface_fraction * self.surface_agreement
        return self.accepted, support * float(np.exp(-self.contradiction))
