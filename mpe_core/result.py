"""What a registration gives back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Inliers:
    """Correspondences closer than the threshold at the final pose, ordered by source index.

    Indices refer to the clouds as the caller passed them, dropped rows counted.
    """

    source: NDArray[np.int64]
    """(K,) indices into the source."""
    target: NDArray[np.int64]
    """(K,) indices of the nearest target points."""
    distance: NDArray[np.float64]
    """(K,) distances in the unit of the input."""
    threshold: float
    """Largest distance that counts, in the unit of the input."""

    def __len__(self) -> int:
        return len(self.source)


@dataclass(frozen=True, slots=True)
class Registration:
    """The pose of the source in the target's frame, and how far to trust it."""

    T_target_source: NDArray[np.float64]
    """(4, 4) rigid transform of column vectors: x_target = R x_source + t, t in the input's
    unit."""
    inliers: Inliers
    overlap: float
    """Share of the (finite) source points that are inliers, in [0, 1]."""
    rmse: float
    """Root mean square distance of the inliers, in the unit of the input."""
    energy: float
    """P2 criterion (Eq. 10 of the paper) at the pose, mean over the source, in [-1, 0]."""
    converged: bool
    iterations: int
    """Iterations of the refinement on the full clouds ("mpl") or of Algorithm 1 ("mpe")."""
    confidence: float
    """How likely the pose is right, in [0, 1]."""
    accepted: bool
    """Whether the confidence reaches 0.5, from which on a pose is taken for right."""
    ambiguous: bool
    """Whether another pose has as much for it: the shape is symmetric, or slides on itself."""
    alternatives: NDArray[np.float64]
    """(K, 4, 4) those other poses, T_target_source in the input's unit; some of them where a shape
    has infinitely many."""
    covariance: NDArray[np.float64]
    """(6, 6) of the error of the pose as a small motion: rotation vector (radians) about the moved
    source's centroid (weighted as its points are), then translation (the input's unit), along the
    target's axes. It covers noise and misfit, not a wrong minimum; along free directions it says a
    radian or a radius of the smaller cloud."""
    free_directions: NDArray[np.float64]
    """(K, 6) such motions that nothing resists, because the surfaces slide on themselves: none for
    most shapes, one along a street, three for a plane or a sphere."""
    warnings: tuple[str, ...]
    timing: dict[str, float]
    """Seconds by stage: prepare, search, refine, inliers, total."""
