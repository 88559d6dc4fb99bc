"""Which points correspond at the final pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.refinement import trimmed_count

NOISE_FACTOR = 3.0
"""Threshold over the root mean square of the trimmed residuals: 3 sigma of a Gaussian."""


def inlier_threshold(distance: NDArray[np.float64], overlap: float | None, spacing: float) -> float:
    """Largest distance of an inlier, estimated from the residuals (N,) at the final pose.

    Three times the root mean square of the residuals that trimmed ICP keeps, but no less than the
    point spacing of the target: two samplings of one surface lie that far apart.
    """
    ordered = np.sort(distance)
    kept = ordered[: trimmed_count(ordered, len(ordered), overlap)]
    return max(NOISE_FACTOR * float(np.sqrt(np.mean(kept**2))), spacing)
