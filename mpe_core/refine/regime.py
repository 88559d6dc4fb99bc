"""Noise and density of a pair of clouds, and the refinement that suits them."""

from __future__ import annotations

from dataclasses import dataclass

from mpe_core.clouds.preprocess import PreparedCloud

FULL_SUM_POINTS = 4000
"""Points up to which a cloud counts as sparse, and which the full sum takes of each cloud."""

DENSE_NOISE_THRESHOLD, SPARSE_NOISE_THRESHOLD = 0.013, 0.0095
"""Roughness in radii above which noise hides the planes of dense and of sparse clouds. Lower values
cost accuracy on facades, higher ones on noisy sparse scans (docs/tuning.md)."""


@dataclass(frozen=True, slots=True)
class Regime:
    """Noise and density of a pair of clouds; lengths in radii of the smaller cloud."""

    roughness: float
    """Roughness of the rougher surface."""
    spacing: float
    """Point spacing of the coarser surface."""
    is_sparse: bool
    """Whether one of the clouds has at most FULL_SUM_POINTS points."""
    is_noisy: bool
    """Whether noise hides the planes of one of the clouds."""
    is_source_smoother: bool
    """Whether the source is less rough than the target."""

    @property
    def uses_full_sum(self) -> bool:
        """Whether the full-sum potential is minimised.

        Sparse noisy clouds have too few points for planes that average the noise.
        """
        return self.is_noisy and self.is_sparse

    @property
    def takes_planes_of_source(self) -> bool:
        """Whether the target is laid on planes of the source.

        Under noise, the planes of the smoother cloud are better.
        """
        return self.is_noisy and self.is_source_smoother

    @property
    def plane_noise(self) -> float:
        """Noise that the planes have to average; 0 if it does not hide them."""
        return self.roughness if self.is_noisy else 0.0


def choose_regime(source: PreparedCloud, target: PreparedCloud) -> Regime:
    """Tell noise and density of the prepared clouds."""
    x, y = source.surface, target.surface
    roughness = max(x.roughness, y.roughness)
    is_sparse = min(len(source.fine), len(target.fine)) <= FULL_SUM_POINTS
    threshold = SPARSE_NOISE_THRESHOLD if is_sparse else DENSE_NOISE_THRESHOLD
    return Regime(
        roughness=roughness,
        spacing=max(x.spacing, y.spacing),
        is_sparse=is_sparse,
        is_noisy=roughness > threshold,
        is_source_smoother=x.roughness < y.roughness,
    )
