"""Farthest-point sampling."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit("int64[::1](float32[:, ::1], int64)", cache=True)
def farthest_order(points, count):
    """Return the rows of `count` points, each the farthest from those before it.

    The first row of points (N, 3) comes first; of equally far points the first row is taken.
    """
    n = points.shape[0]
    distance = np.full(n, np.float32(np.inf))
    order = np.empty(count, np.int64)
    row = 0
    for k in range(count):
        order[k] = row
        x, y, z = points[row, 0], points[row, 1], points[row, 2]
        farthest = np.float32(-1)
        for i in range(n):
            d = (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2 + (points[i, 2] - z) ** 2
            if d < distance[i]:
                distance[i] = d
            if distance[i] > farthest:
                farthest = distance[i]
                row = i
    return order
