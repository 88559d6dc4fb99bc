"""Points and correspondences by row; numpy takes five times as long for millions of them."""

from __future__ import annotations

import numpy as np
from numba import float64, njit, prange

from mpe_core.kernels.extent import GIVEN, SINGLE


@njit(
    [float64[:, ::1](GIVEN, GIVEN), float64[:, ::1](GIVEN, SINGLE)],
    cache=True,
    parallel=True,
)
def transformed(T, points):
    """(N, 3) points R x + t."""
    found = np.empty((points.shape[0], 3), np.float64)
    for i in prange(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for a in range(3):
            found[i, a] = T[a, 0] * x + T[a, 1] * y + T[a, 2] * z + T[a, 3]
    return found


@njit("float32[:, ::1](float32[:, ::1], int32[::1])", cache=True, parallel=True)
def columns_at(points, rows):
    """(3, N) points at the rows (N,)."""
    found = np.empty((3, rows.shape[0]), np.float32)
    for i in prange(rows.shape[0]):
        for a in range(3):
            found[a, i] = points[rows[i], a]
    return found


@njit("int64[::1](int32[::1], int32[::1], int32[::1])", cache=True, parallel=True)
def rows_as_given(places, rows, order):
    """(N,) rows[places], or -1 where a place is -1, of queries that were asked in this order, in
    the order that they came in."""
    found = np.full(places.shape[0], np.int64(-1))
    for i in prange(places.shape[0]):
        if places[i] >= 0:
            found[order[i]] = rows[places[i]]
    return found


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
