"""Bounds and moments of millions of points; numpy takes five times as long."""

from __future__ import annotations

import numpy as np
from numba import float32, float64, njit, prange, types

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
    found = np.zeros((tasks, 3, 3))
    for task in prange(tasks):
        found[task, 0], found[task, 1] = np.inf, -np.inf
        for i in range(task * ROWS_PER_TASK, min(n, (task + 1) * ROWS_PER_TASK)):
            for a in range(3):
                found[task, 0, a] = min(found[task, 0, a], points[i, a])
                found[task, 1, a] = max(found[task, 1, a], points[i, a])
                found[task, 2, a] += points[i, a] - points[0, a]
    return found


@njit(float64[:, :, ::1](GIVEN, float64[::1], float64), cache=True, parallel=True)
def products(points, centre, length):
    """(tasks, 3, 3) sums of v v^T over the points' offsets v from the centre, in lengths."""
    n = points.shape[0]
    tasks = (n + ROWS_PER_TASK - 1) // ROWS_PER_TASK
    found = np.zeros((tasks, 3, 3))
    for task in prange(tasks):
        for i in range(task * ROWS_PER_TASK, min(n, (task + 1) * ROWS_PER_TASK)):
            for a in range(3):
                v = (points[i, a] - centre[a]) / length
                for b in range(3):
                    found[task, a, b] += v * (points[i, b] - centre[b]) / length
    return found


@njit(float64[:, ::1](GIVEN, float64[::1], float64), cache=True, parallel=True)
def centred(points, centre, length):
    """(N, 3) the points' offsets from the centre, in lengths."""
    found = np.empty((points.shape[0], 3), np.float64)
    for i in prange(points.shape[0]):
        for a in range(3):
            found[i, a] = (points[i, a] - centre[a]) / length
    return found
