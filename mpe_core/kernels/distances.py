"""Distances of corresponding points."""

from __future__ import annotations

import numpy as np
from numba import njit, prange


@njit(
    "float64[::1](float64[:, ::1], float64[:, ::1], int64[::1])",
    cache=True,
    parallel=True,
)
def row_distances(points, cloud, rows):
    """(N,) distance of each point (N, 3) from its row (N,) of the cloud (M, 3); infinite for
    -1."""
    distance = np.full(points.shape[0], np.inf)
    for i in prange(points.shape[0]):
        j = rows[i]
        if j >= 0:
            dx = points[i, 0] - cloud[j, 0]
            dy = points[i, 1] - cloud[j, 1]
            dz = points[i, 2] - cloud[j, 2]
            distance[i] = np.sqrt(dx * dx + dy * dy + dz * dz)
    return distance
