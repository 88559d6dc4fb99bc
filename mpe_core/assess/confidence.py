"""Evidence for a pose, and the confidence that it gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpe_core.options import ACCEPTANCE_THRESHOLD

NOISY_AGREEMENT_WEIGHT, NOISY_COVERAGE_WEIGHT, NOISY_INTERCEPT = 18.6, 6.6, -18.7
"""Logistic model of right against wrong poses where noise hides the shape (docs/tuning.md)."""

AGREEMENT_WEIGHT, COVERAGE_WEIGHT, SHAPE_WEIGHT, INTERCEPT = 6.5, 0.6, 8.3, -10.7
"""The model where shape is told; of the coverage, the logarithm of what lacks to ENOUGH_COVERAGE
counts (docs/tuning.md)."""

SEEN_AGREEMENT_WEIGHT, SEEN_COVERAGE_WEIGHT, SEEN_SHAPE_WEIGHT = 0.5, 2.6, 9.5
VIOLATION_WEIGHT, SEEN_INTERCEPT = 19.0, -5.2
"""The model where shape is told and both viewpoints are known (docs/tuning.md)."""

LAYER_WEIGHT, SEEN_LAYER_WEIGHT = 10.6, 8.2
"""How much the score falls with what lacks to CONVINCING_LAYER_SUPPORT, without and with
viewpoints."""

CONTRAST_MODEL, SEEN_CONTRAST_MODEL = (0.66, 0.85, -2.0), (1.0, 1.4, -4.2)
"""Weights of score and contrast, and intercept, of the model of the best of several poses, without
and with viewpoints (docs/tuning.md)."""

MAX_CONTRAST = 6.0
"""Contrast from which on more says nothing; also that of a pose without any rival."""

ENOUGH_COVERAGE, MIN_COVERAGE = 0.3, 0.01
"""Coverage from which on more says nothing, and its least value."""

CONVINCING_LAYER_SUPPORT = 0.8
"""Support by the layers from which on a pose counts as the best one (docs/tuning.md)."""

MIN_PLAUSIBLE_AGREEMENT, MIN_PLAUSIBLE_COVERAGE = 0.5, 0.05
"""Agreement and coverage from which on the layers of a pose are a measure for others; right poses
of levelled scenes have 0.66 and 0.1 at least (docs/tuning.md)."""

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
    shape_correlation: float | None = None
    """Rank correlation of the surface variation of points that meet; None where noise hides it."""
    free_space_violation: float | None = None
    """Share of the visible points of one scan that stand in what the other one saw through; None
    where the scanners' positions are not known."""
    layer_support: float | None = None
    """Score of the pose as seen from above over that of the best pose that was found, from 0 to 1;
    None where the clouds show no ground, or not the same at the pose."""
    contrast: float | None = None
    """Score of the pose less that of the best different one; None where no other was compared."""
    degenerate_dof: int = 0
    """Number of directions in which the surfaces slide on themselves; counted only beyond
    MAX_CALIBRATED_SIZE_RATIO."""

    @property
    def confidence(self) -> float:
        """Probability that the pose is right, in [0, 1]."""
        return float(1 / (1 + np.exp(-self.log_odds)))

    @property
    def log_odds(self) -> float:
        """Logarithm of the odds that the pose is right."""
        excess = max(1.0, self.size_ratio / MAX_CALIBRATED_SIZE_RATIO)
        odds = self.score
        if self.contrast is not None and self.shape_correlation is not None:
            model = CONTRAST_MODEL if self.free_space_violation is None else SEEN_CONTRAST_MODEL
            odds = model[0] * odds + model[1] * min(self.contrast, MAX_CONTRAST) + model[2]
        return odds - (2 + self.degenerate_dof) * float(np.log(excess))

    @property
    def score(self) -> float:
        """Log odds of the pose by itself, between clouds of like size."""
        coverage = min(1.0, self.coverage / self.overlap)
        lacking = float(np.log(np.clip(coverage, MIN_COVERAGE, ENOUGH_COVERAGE) / ENOUGH_COVERAGE))
        violation = self.free_space_violation
        if self.shape_correlation is None:
            score = NOISY_AGREEMENT_WEIGHT * self.surface_agreement
            score += NOISY_COVERAGE_WEIGHT * coverage + NOISY_INTERCEPT
        elif violation is None:
            score = AGREEMENT_WEIGHT * self.surface_agreement + COVERAGE_WEIGHT * lacking
            score += SHAPE_WEIGHT * self.shape_correlation + INTERCEPT
        else:
            score = SEEN_AGREEMENT_WEIGHT * self.surface_agreement + SEEN_COVERAGE_WEIGHT * lacking
            score += SEEN_SHAPE_WEIGHT * self.shape_correlation + SEEN_INTERCEPT
        if violation is not None:
            score -= VIOLATION_WEIGHT * violation
        if self.layer_support is not None:
            weight = LAYER_WEIGHT if violation is None else SEEN_LAYER_WEIGHT
            score -= weight * max(0.0, CONVINCING_LAYER_SUPPORT - self.layer_support)
        return score

    @property
    def is_plausible(self) -> bool:
        """Whether enough of the cloud lies on the surface to measure other poses by this one."""
        return (
            self.surface_agreement >= MIN_PLAUSIBLE_AGREEMENT
            and self.coverage >= MIN_PLAUSIBLE_COVERAGE
        )

    @property
    def accepted(self) -> bool:
        """Whether the pose is taken for right."""
        return self.confidence >= ACCEPTANCE_THRESHOLD

    @property
    def sort_key(self) -> tuple[bool, float]:
        """Key that is greatest for the best of several poses of a pair.

        The agreement alone does not see that another pose lays more points on the target.
        """
        if self.shape_correlation is not None or self.free_space_violation is not None:
            return self.accepted, self.score
        return self.accepted, self.on_surface_fraction * self.surface_agreement
