"""Points and correspondences by row; numpy takes five times as long for millions of them.

What has as many rows as the clouds is written into arrays that the caller brings, numpy's: numpy
asks the system for huge pages, numba does not. Ten million points onto ten million, median of eight
calls on a virtual machine: 2.3 s, where numba's arrays took 2.5.
"""

from __future__ import annotations

import numpy as np
from numba import float64, njit, prange, void

from mpe_core.kernels.bounds import GIVEN, SINGLE


@njit(
    [void(GIVEN, GIVEN, float64[:, ::1]), void(GIVEN, SINGLE, float64[:, ::1])],
    cache=True,
    parallel=True,
)
def transformed(T, points, found):
    """found (N, 3) = points R x + t."""
    for i in prange(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for a in range(3):
            found[i, a] = T[a, 0] * x + T[a, 1] * y + T[a, 2] * z + T[a, 3]


@njit("void(float32[:, ::1], int32[::1], float32[:, ::1])", cache=True, parallel=True)
def columns_at(points, rows, found):
    """found (3, N) = points at the rows (N,)."""
    for i in prange(rows.shape[0]):
        for a in range(3):
            found[a, i] = points[rows[i], a]


@njit("void(int32[::1], int32[::1], int32[::1], int64[::1])", cache=True, parallel=True)
def rows_as_given(places, rows, order, found):
    """found (N,) = rows[places], or -1 where a place is -1, of queries that were asked in this
    order, in the order that they came in."""
    for i in prange(places.shape[0]):
        found[order[i]] = rows[places[i]] if places[i] >= 0 else -1


@njit(
    "void(float64[:, ::1], float64[:, ::1], int64[::1], float64, float64[::1])",
    cache=True,
    parallel=True,
)
def row_distances(points, cloud, rows, unit, found):
    """found (N,) = distance, in units, of each point (N, 3) from its row (N,) of the cloud (M, 3);
    infinite for -1."""
    for i in prange(points.shape[0]):
        j = rows[i]
        found[i] = np.inf
        if j >= 0:
            dx = points[i, 0] - cloud[j, 0]
            dy = points[i, 1] - cloud[j, 1]
            dz = points[i, 2] - cloud[j, 2]
            found[i] = unit * np.sqrt(dx * dx + dy * dy + dz * dz)
