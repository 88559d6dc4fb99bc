"""Which points correspond at the final pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.paper.trimmed_icp import trimmed_count

NOISE_FACTOR = 3.0
"""Threshold over the root mean square of the inlier distances: 3 sigma of a Gaussian."""

ROUNDS = 5
"""From trimmed ICP's cut, which is too low, 5 rounds come within 3 % of the fixed point."""


def inlier_threshold(distance: NDArray[np.float64], overlap: float | None, spacing: float) -> float:
    """Largest distance of an inlier, estimated from the residuals (N,) at the final pose, infinite
    where nothing is near.

    Three times the root mean square of the residuals below it, found by sigma clipping from those
    that trimmed ICP keeps; but no less than the point spacing of the target: two samplings of one
    surface lie that far apart.
    """
    ordered = np.sort(distance[np.isfinite(distance)])
    if len(ordered) < 3:
        return spacing
    mean_square = np.cumsum(ordered**2) / np.arange(1, len(ordered) + 1)
    kept = trimmed_count(ordered, len(distance), overlap)
    for _ in range(ROUNDS):
        threshold = max(NOISE_FACTOR * float(np.sqrt(mean_square[kept - 1])), spacing)
        kept = max(3, int(np.searchsorted(ordered, threshold, side="right")))
    return threshold
