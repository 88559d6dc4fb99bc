"""Elementwise loops over the rows of large clouds, five times as fast as numpy.

Results are written into an array `out` that the caller allocates with numpy, which asks the system
for huge pages; numba does not.
"""

from __future__ import annotations

import numpy as np
from numba import float64, njit, prange, void

from mpe_core.kernels.bounds import POINTS32, POINTS64


@njit(
    [void(POINTS64, POINTS64, float64[:, ::1]), void(POINTS64, POINTS32, float64[:, ::1])],
    cache=True,
    parallel=True,
)
def transform_points(T, points, out):
    """Write R x + t of each point x (N, 3) into out (N, 3); T is a (4, 4) pose."""
    for i in prange(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for a in range(3):
            out[i, a] = T[a, 0] * x + T[a, 1] * y + T[a, 2] * z + T[a, 3]


@njit("void(float32[:, ::1], int32[::1], float32[:, ::1])", cache=True, parallel=True)
def gather_columns(points, rows, out):
    """Write the points at the rows (N,) into the columns of out (3, N)."""
    for i in prange(rows.shape[0]):
        for a in range(3):
            out[a, i] = points[rows[i], a]


@njit("void(int32[::1], int32[::1], int32[::1], int64[::1])", cache=True, parallel=True)
def restore_order(places, rows, order, out):
    """Translate the answers to reordered queries into the caller's rows and order.

    Writes rows[places[i]] into out[order[i]], or -1 where places[i] is -1.

    Parameters
    ----------
    places
        (N,) answers: rows of the reordered cloud, or -1.
    rows
        (M,) row of the caller's cloud of each row of the reordered one.
    order
        (N,) place of each reordered query among the caller's.
    out
        (N,) receives the rows of the caller's cloud.
    """
    for i in prange(places.shape[0]):
        out[order[i]] = rows[places[i]] if places[i] >= 0 else -1


@njit(
    "void(float64[:, ::1], float64[:, ::1], int64[::1], float64, float64[::1])",
    cache=True,
    parallel=True,
)
def correspondence_distances(points, cloud, rows, unit, out):
    """Write the distance of each point from its correspondence into out (N,), times `unit`.

    The correspondence of points (N, 3) are the rows (N,) of the cloud (M, 3); the distance to row
    -1 is infinite.
    """
    for i in prange(points.shape[0]):
        j = rows[i]
        out[i] = np.inf
        if j >= 0:
            dx = points[i, 0] - cloud[j, 0]
            dy = points[i, 1] - cloud[j, 1]
            dz = points[i, 2] - cloud[j, 2]
            out[i] = unit * np.sqrt(dx * dx + dy * dy + dz * dz)
