"""Evidence for a pose, and the confidence that it gives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mpe_core.options import ACCEPTANCE_THRESHOLD

DOUBTED_CONFIDENCE = 0.3
"""Confidence of a pose that fits, but is refused for another scale or hand, or since it slides."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """Logistic model of right against wrong poses: weights of the evidence."""

    agreement: float
    """Weight of the surface agreement."""
    coverage: float = 0.0
    """Weight of the coverage."""
    small_coverage: float = 0.0
    """Weight of the logarithm of the coverage over ENOUGH_COVERAGE, where there is less."""
    shape: float = 0.0
    """Weight of the shape correlation."""
    violation: float = 0.0
    """Fall with the violation of free space."""
    layers: float
    """Fall with what lacks to CONVINCING_LAYER_SUPPORT."""
    intercept: float
    best: tuple[float, float, float]
    """Weights of score and contrast, and intercept, of the best of several poses."""


MODEL = Model(
    agreement=8.84,
    small_coverage=1.78,
    shape=6.21,
    layers=4.17,
    intercept=-11.59,
    best=(0.69, 0.87, -1.79),
)
"""Fitted to all families (docs/results/families.md); a wrong pose counts twice."""

SEEN_MODEL = Model(
    agreement=1.11,
    small_coverage=3.46,
    shape=6.52,
    violation=20.38,
    layers=8.88,
    intercept=-3.54,
    best=(1.40, 1.34, -3.26),
)
"""The same where both viewpoints are known (docs/results/families.md)."""

BEST_OF_HIDDEN = (0.16, 0.94, -3.25)
"""Weights of score and contrast, and intercept, of the best of several poses where the shape is
hidden: flat sides fit at many poses (docs/results/hidden_shape.md)."""

NOISY_MODEL = Model(agreement=18.6, coverage=6.6, layers=5.0, intercept=-18.7, best=BEST_OF_HIDDEN)
"""Where noise hides the shape; fitted to shared pairs with noise (docs/results/calibration.md)."""

NOISY_SEEN_MODEL = Model(
    agreement=20.0,
    small_coverage=1.5,
    violation=20.0,
    layers=5.0,
    intercept=-12.2,
    best=BEST_OF_HIDDEN,
)
"""Where noise hides the shape, but both viewpoints are known (docs/tuning.md)."""

MAX_CONTRAST = 6.0
"""Contrast from which on more says nothing; also that of a pose without any rival."""

CONTRAST_OF_LEAD = 15.0
"""Contrast that a lead of 1 stands for (docs/tuning.md)."""

MAX_LIFT_OF_HIDDEN = 3.0
"""What contrast adds at most to the log odds of a pose whose shape is hidden: what by itself is
against it stays against it (docs/tuning.md)."""

WHOLE_AGREEMENT, WHOLE_COVERAGE, CONTRAST_OF_WHOLE = 0.95, 0.99, 3.0
"""Agreement and coverage from which on a cloud whose shape is hidden fits as a whole, and its least
contrast: a ball or a cube has several right poses (docs/tuning.md)."""

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
    """What the pose has over the different ones; None where no other was compared."""
    explains_all: bool = False
    """Whether the pose alone explains every point of both clouds, beside others that nearly do."""
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
        odds = self.score if self.contrast is None else self._log_odds_of_best(self.contrast)
        return odds - (2 + self.degenerate_dof) * float(np.log(excess))

    def _log_odds_of_best(self, contrast: float) -> float:
        """Log odds of the best of several poses, between clouds of like size."""
        contrast = MAX_CONTRAST if self.explains_all else min(contrast, MAX_CONTRAST)
        of_score, of_contrast, intercept = self._model.best
        is_hidden = self.shape_correlation is None
        if is_hidden and self.size_ratio > MAX_CALIBRATED_SIZE_RATIO:
            # the model saw clouds of like size: the fit of a part has to outweigh chance by itself
            return self.score + of_contrast * (contrast - MAX_CONTRAST)
        if is_hidden and self.fits_whole:
            contrast = max(contrast, CONTRAST_OF_WHOLE)
        odds = of_score * self.score + of_contrast * contrast + intercept
        return min(odds, self.score + MAX_LIFT_OF_HIDDEN) if is_hidden else odds

    @property
    def score(self) -> float:
        """Log odds of the pose by itself, between clouds of like size."""
        model, coverage = self._model, min(1.0, self.coverage / self.overlap)
        small = float(np.log(np.clip(coverage, MIN_COVERAGE, ENOUGH_COVERAGE) / ENOUGH_COVERAGE))
        support = CONVINCING_LAYER_SUPPORT if self.layer_support is None else self.layer_support
        return (
            model.agreement * self.surface_agreement
            + model.coverage * coverage
            + model.small_coverage * small
            + model.shape * (self.shape_correlation or 0.0)
            - model.violation * (self.free_space_violation or 0.0)
            - model.layers * max(0.0, CONVINCING_LAYER_SUPPORT - support)
            + model.intercept
        )

    @property
    def _model(self) -> Model:
        """Model for what is known of the pose."""
        if self.shape_correlation is None:
            return NOISY_MODEL if self.free_space_violation is None else NOISY_SEEN_MODEL
        return MODEL if self.free_space_violation is None else SEEN_MODEL

    @property
    def is_plausible(self) -> bool:
        """Whether enough of the cloud lies on the surface to measure other poses by this one."""
        return (
            self.surface_agreement >= MIN_PLAUSIBLE_AGREEMENT
            and self.coverage >= MIN_PLAUSIBLE_COVERAGE
        )

    @property
    def fits_whole(self) -> bool:
        """Whether all of the cloud lies on the surface, so that other such poses are as right."""
        return self.surface_agreement >= WHOLE_AGREEMENT and self.coverage >= WHOLE_COVERAGE

    @property
    def convinces(self) -> bool:
        """Whether the pose would be accepted by itself, whatever others there are."""
        return replace(self, contrast=None).accepted

    @property
    def fits(self) -> bool:
        """Whether the pose is accepted, or would be by itself."""
        return self.accepted or self.convinces

    @property
    def accepted(self) -> bool:
        """Whether the pose is taken for right."""
        return self.confidence >= ACCEPTANCE_THRESHOLD

    @property
    def sort_key(self) -> tuple[bool, float]:
        """Key that is greatest for the best of several poses of a pair.

        The agreement alone does not see that another pose lays more points on the target.
        """
        convinces = self.convinces or self.explains_all
        if self.shape_correlation is not None or self.free_space_violation is not None:
            # of poses that score alike the one that explains more of the cloud
            return convinces, self.score + self.on_surface_fraction
        return convinces, self.on_surface_fraction * self.surface_agreement
