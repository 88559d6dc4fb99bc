"""Order of a large cloud in memory: points that are close in space are close in memory."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.cell_list import GRID, cell_key, hash_slot

BUCKET_COUNT = 2048
"""Number of buckets; a power of two. Slow from 16,384 on, when their write positions leave the
cache (docs/tuning.md)."""

PILLAR_BITS = 2
"""A pillar is 2**PILLAR_BITS cells wide along x and y, and has all cells along z."""

TASK_COUNT = 32
"""Number of tasks; each has a fixed range of rows, so the order does not depend on the threads."""


@njit("int64(float32, float32, float32[::1], float32)", cache=True, inline="always")
def bucket_of(x, y, origin, inverse):
    """Return the bucket of the pillar at (x, y); several pillars share a bucket."""
    ix = np.int64(np.floor((x - origin[0]) * inverse))
    iy = np.int64(np.floor((y - origin[1]) * inverse))
    key = cell_key(ix >> PILLAR_BITS, iy >> PILLAR_BITS, 0)
    return hash_slot(key, 8 * BUCKET_COUNT - 1) >> 3


@njit(
    f"int64[::1](float32[:, ::1], {GRID}, float32[:, ::1], int32[::1])",
    cache=True,
    parallel=True,
)
def partition(points, grid, out, rows):
    """Sort points (N, 3) by the bucket of the pillar that they stand in.

    The order within a bucket is that of the cloud (counting sort).

    Parameters
    ----------
    points, grid
        The cloud, and the cells that no bucket divides.
    out
        (N, 3) receives the points in their new order.
    rows
        (N,) receives the row that each came from.

    Returns
    -------
    (buckets + 1,) bucket b holds the rows bounds[b]:bounds[b + 1] of `out`.
    """
    origin, size = grid
    n = points.shape[0]
    inverse = np.float32(1.0) / size
    rows_per_task = (n + TASK_COUNT - 1) // TASK_COUNT
    places = np.zeros((TASK_COUNT, BUCKET_COUNT), np.int64)
    for task in prange(TASK_COUNT):
        for i in range(task * rows_per_task, min(n, (task + 1) * rows_per_task)):
            places[task, bucket_of(points[i, 0], points[i, 1], origin, inverse)] += 1
    bounds = np.empty(BUCKET_COUNT + 1, np.int64)
    place = 0
    for b in range(BUCKET_COUNT):
        bounds[b] = place
        for task in range(TASK_COUNT):
            count = places[task, b]
            places[task, b] = place
            place += count
    bounds[BUCKET_COUNT] = n
    for task in prange(TASK_COUNT):
        for i in range(task * rows_per_task, min(n, (task + 1) * rows_per_task)):
            b = bucket_of(points[i, 0], points[i, 1], origin, inverse)
            place = places[task, b]
            for a in range(3):
                out[place, a] = points[i, a]
            rows[place] = i
            places[task, b] = place + 1
    return bounds
