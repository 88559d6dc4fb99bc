"""Evidence for a pose, and the confidence that it gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpe_core.options import ACCEPTANCE_THRESHOLD

AGREEMENT_WEIGHT, COVERAGE_WEIGHT, INTERCEPT = 18.6, 6.6, -18.7
"""Logistic model of right against wrong poses, fitted by `python -m benchmarks calibration` to half
of the pairs; a wrong pose counts twice (docs/tuning.md)."""

SEEN_AGREEMENT_WEIGHT, SEEN_COVERAGE_WEIGHT = 20.0, 1.5
VIOLATION_WEIGHT, SEEN_INTERCEPT = 20.0, -12.2
"""The model where both viewpoints are known: of the coverage only the logarithm of what lacks to
ENOUGH_COVERAGE counts, and free space says the rest (docs/tuning.md)."""

ENOUGH_COVERAGE, MIN_COVERAGE = 0.3, 0.01
"""Coverage from which on more says nothing where free space is known, and its least value."""

CONVINCING_LAYER_SUPPORT, LAYER_WEIGHT = 0.8, 5.0
"""Support by the layers from which on a pose counts as the best one, and how much the log odds fall
with what lacks to it (docs/tuning.md)."""

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
    free_space_violation: float | None = None
    """Share of the visible points of one scan that stand in what the other one saw through; None
    where the scanners' positions are not known."""
    layer_support: float | None = None
    """Score of the pose as seen from above over that of the best pose that was found, from 0 to 1;
    None where the clouds show no ground, or not the same at the pose."""
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
        return self._log_odds_of_like_size - (2 + self.degenerate_dof) * float(np.log(excess))

    @property
    def _log_odds_of_like_size(self) -> float:
        """Log odds between clouds of like size."""
        if self.free_space_violation is None:
            coverage = min(1.0, self.coverage / self.overlap)
            logit = AGREEMENT_WEIGHT * self.surface_agreement + COVERAGE_WEIGHT * coverage
            return logit + INTERCEPT - self._lack_of_support
        coverage = min(max(self.coverage, MIN_COVERAGE), ENOUGH_COVERAGE) / ENOUGH_COVERAGE
        logit = SEEN_AGREEMENT_WEIGHT * self.surface_agreement
        logit += SEEN_COVERAGE_WEIGHT * float(np.log(coverage)) + SEEN_INTERCEPT
        return logit - VIOLATION_WEIGHT * self.free_space_violation - self._lack_of_support

    @property
    def _lack_of_support(self) -> float:
        """Fall of the log odds by what the layers of a better pose have and this one lacks."""
        if self.layer_support is None:
            return 0.0
        return LAYER_WEIGHT * max(0.0, CONVINCING_LAYER_SUPPORT - self.layer_support)

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
        if self.free_space_violation is not None:
            return self.accepted, self.log_odds
        support = self.on_surface_fraction * self.surface_agreement
        return self.accepted, support * float(np.exp(-self._lack_of_support))
