"""Shape: at a right pose bent places meet bent ones, and flat places flat ones.

Flat surfaces that slide on each other match at any shift; where the edges and bends are does not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Variation = NDArray[np.float32]

MIN_SPREAD = 1.7
"""Square root of the 95th over that of the 25th percentile of the surface variation from which on
it tells shape rather than noise: pure noise has 1.2 to 1.6 (docs/tuning.md)."""

FLAT_VARIATION = 1e-4
"""Surface variation below which all is flat: the order of what rounding left tells nothing."""

MIN_POINTS = 25
"""Points that have to meet; the correlation of fewer is chance."""


def tells_shape(variation: Variation) -> bool:
    """Whether the surface variation (N,) of a cloud tells bent places from flat ones."""
    known = variation[~np.isnan(variation)]
    if len(known) < MIN_POINTS:
        return False
    low, high = np.sqrt(np.quantile(np.maximum(known, FLAT_VARIATION), (0.25, 0.95)))
    return bool(high > MIN_SPREAD * low)


def shape_correlation(moving: Variation, fixed: Variation) -> float:
    """Rank correlation (Spearman 1904) of the surface variation (N,) of points that meet.

    The variation is the smallest eigenvalue of the covariance around a point over the sum of all
    three (Pauly et al. 2002).

    Returns
    -------
    float
        From -1 to 1; 0 if too few points meet, or if all are alike.
    """
    known = ~np.isnan(moving) & ~np.isnan(fixed)
    moving, fixed = moving[known], fixed[known]
    if len(moving) < MIN_POINTS:
        return 0.0
    a, b = (_ranks(np.maximum(each, FLAT_VARIATION)) for each in (moving, fixed))
    a, b = a - a.mean(), b - b.mean()
    norm = float(np.sqrt(np.square(a).sum() * np.square(b).sum()))
    return float((a * b).sum()) / norm if norm > 0 else 0.0


def _ranks(values: Variation) -> NDArray[np.float64]:
    """(N,) mean ranks of the values (N,): as scipy's, whose checks take longer than the ranking."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    ranks: NDArray[np.float64] = (np.cumsum(count) - (count - 1) / 2)[place]
    return ranks
