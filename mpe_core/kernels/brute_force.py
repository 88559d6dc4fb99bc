"""Nearest points of a few queries, by looking at all: a tree would take longer to build."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit("float64[:, ::1](float64[:, ::1], int64[::1], int64)", cache=True)
def nearest_distances(points, rows, count):
    """Find the distances from some of the points to those that are nearest to them.

    Parameters
    ----------
    points
        (N, 3) points.
    rows
        (K,) those that are asked for.
    count
        Number of nearest points, without the point itself.

    Returns
    -------
    (K, count) distances in ascending order; infinite beyond N - 1.
    """
    squared = np.full((len(rows), count), np.inf)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for k in range(len(rows)):
            row = rows[k]
            dx, dy, dz = x - points[row, 0], y - points[row, 1], z - points[row, 2]
            d = dx * dx + dy * dy + dz * dz
            if d < squared[k, count - 1] and i != row:
                place = count - 1
                while place > 0 and squared[k, place - 1] > d:
                    squared[k, place] = squared[k, place - 1]
                    place -= 1
                squared[k, place] = d
    return np.sqrt(squared)
