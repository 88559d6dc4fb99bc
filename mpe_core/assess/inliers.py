"""Correspondences at the final pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.normalize import CloudPair
from mpe_core.geometry.nearest import nearest_rows
from mpe_core.geometry.rigid import apply
from mpe_core.kernels.point_rows import correspondence_distances
from mpe_core.paper.trimmed_icp import trimmed_count
from mpe_core.result import Inliers

THRESHOLD_RMS = 3.0
"""Threshold over the root mean square of the inlier distances: 3 sigma of a Gaussian."""

CLIPPING_ROUNDS = 5
"""Rounds of sigma clipping; from the cut of trimmed ICP they come within 3 % of the fixed point."""


def estimate_inlier_threshold(
    distances: NDArray[np.float64], overlap: float | None, spacing: float
) -> float:
    """Estimate the largest distance of an inlier from the residuals at the final pose.

    Three times the root mean square of the residuals below it, found by sigma clipping from those
    that trimmed ICP keeps; but at least the point spacing: two samplings of one surface lie that
    far apart.

    Parameters
    ----------
    distances
        (N,) distances of source points from the target; infinite where nothing is near.
    overlap
        Share of the source that has a counterpart; None if it is unknown.
    spacing
        Point spacing in the same unit.
    """
    ordered = np.sort(distances[np.isfinite(distances)])
    if len(ordered) < 3:
        return spacing
    mean_square = np.cumsum(ordered**2) / np.arange(1, len(ordered) + 1)
    kept = trimmed_count(ordered, len(distances), overlap)
    for _ in range(CLIPPING_ROUNDS):
        threshold = max(THRESHOLD_RMS * float(np.sqrt(mean_square[kept - 1])), spacing)
        kept = max(3, int(np.searchsorted(ordered, threshold, side="right")))
    return threshold


def find_inliers(pair: CloudPair, T: NDArray[np.float64], threshold: float) -> Inliers:
    """Find the source points whose nearest target point is within the threshold.

    Parameters
    ----------
    pair
        Normalized clouds.
    T
        (4, 4) pose between them.
    threshold
        Largest distance, in the caller's unit.
    """
    moved = apply(T, pair.source)
    nearest = nearest_rows(moved, pair.target, threshold / pair.unit)
    distance = np.empty(len(moved))
    correspondence_distances(moved, pair.target, nearest, pair.unit, distance)
    close = np.flatnonzero(distance <= threshold)
    return Inliers(
        pair.source_cloud.original_index(close),
        pair.target_cloud.original_index(nearest[close]),
        distance[close],
        threshold,
    )
