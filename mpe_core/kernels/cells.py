"""Cell lists: points hashed into cubes, for thinning and nearest points.

A grid is four arrays: `keys` (table,) int64 cell key or -1, `slots` (table,) int32 cell number,
`starts` (cells + 1,) int32, and the points reordered so that cell c holds rows
starts[c]:starts[c+1].
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

F32 = np.float32
LAST_CELL = 2**21 - 2
"""A key holds 21 bits an axis."""


@njit("int64(int64, int64, int64)", cache=True, inline="always")
def cell_key(ix, iy, iz):
    return (ix << 42) | (iy << 21) | iz


@njit("int64(int64, int64)", cache=True, inline="always")
def hash_slot(key, mask):
    h = key * np.int64(-7046029254386353131)
    h ^= h >> 32
    h *= np.int64(-4417276706812531889)
    return (h ^ (h >> 29)) & mask


@njit("int64(int64[::1], int64, int64)", cache=True, inline="always")
def find_slot(keys, key, mask):
    """Slot that holds the key, or the free slot where it belongs."""
    slot = hash_slot(key, mask)
    while keys[slot] != -1 and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@njit(
    "Tuple((int64[::1], int32[::1], int32[::1], int32[::1]))"
    "(float32[:, ::1], float32[::1], float32)",
    cache=True,
)
def number_cells(points, origin, size):
    """Number the occupied cells in order of first appearance: (keys, slots, cell of point,
    counts)."""
    n = points.shape[0]
    table = 16
    while table < 2 * n:
        table *= 2
    keys = np.full(table, np.int64(-1))
    slots = np.empty(table, np.int32)
    cell_of = np.empty(n, np.int32)
    counts = np.zeros(n, np.int32)
    inverse = np.float32(1.0) / size
    cells = 0
    for i in range(n):
        key = cell_key(
            np.int64((points[i, 0] - origin[0]) * inverse),
            np.int64((points[i, 1] - origin[1]) * inverse),
            np.int64((points[i, 2] - origin[2]) * inverse),
        )
        slot = find_slot(keys, key, table - 1)
        if keys[slot] == -1:
            keys[slot] = key
            slots[slot] = cells
            cells += 1
        cell_of[i] = slots[slot]
        counts[slots[slot]] += 1
    return keys, slots, cell_of, counts[:cells]


@njit(
    "Tuple((float32[:, ::1], int32[::1], int32[::1]))(float32[:, ::1], int32[::1], int32[::1])",
    cache=True,
)
def sort_by_cell(points, cell_of, counts):
    """Points in cell order: (sorted points, starts, original row of each sorted point)."""
    starts = np.zeros(counts.shape[0] + 1, np.int32)
    for c in range(counts.shape[0]):
        starts[c + 1] = starts[c] + counts[c]
    place = starts[:-1].copy()
    ordered = np.empty_like(points)
    rows = np.empty(points.shape[0], np.int32)
    for i in range(points.shape[0]):
        k = place[cell_of[i]]
        place[cell_of[i]] = k + 1
        ordered[k, 0] = points[i, 0]
        ordered[k, 1] = points[i, 1]
        ordered[k, 2] = points[i, 2]
        rows[k] = i
    return ordered, starts, rows


@njit("Tuple((float32[:, ::1], int32[::1]))(float32[:, ::1], float32[::1], float32)", cache=True)
def cell_means(points, origin, size):
    """Mean and count of the points of each occupied cell."""
    _, _, cell_of, counts = number_cells(points, origin, size)
    sums = np.zeros((counts.shape[0], 3), np.float64)
    for i in range(points.shape[0]):
        c = cell_of[i]
        sums[c, 0] += points[i, 0]
        sums[c, 1] += points[i, 1]
        sums[c, 2] += points[i, 2]
    means = np.empty((counts.shape[0], 3), np.float32)
    for c in range(counts.shape[0]):
        for a in range(3):
            means[c, a] = sums[c, a] / counts[c]
    return means, counts


# the middle cell first: what it holds rules out most of the others
STEPS = (0, -1, 1)


@njit("float32(int64, float32, float32)", cache=True, inline="always")
def gap(step, inside, size):
    """Squared distance along one axis to the cell a step away, from `inside` the middle one; a
    little less, because points are numbered in rounded arithmetic."""
    d = np.float32(0.999) * (inside if step < 0 else size - inside)
    return np.float32(0.0) if step == 0 else d * d


@njit(
    "Tuple((int32[::1], float32[::1]))"
    "(float32[:, ::1], float32[:, ::1], int32[::1], int64[::1], int32[::1], float32[::1], float32)",
    cache=True,
    parallel=True,
)
def nearest_within(queries, points, starts, keys, slots, origin, radius):
    """Row of the nearest point within `radius` (the cell size) of each query, or -1, and the
    squared distance."""
    n = queries.shape[0]
    nearest = np.full(n, np.int32(-1))
    squared = np.full(n, np.float32(np.inf))
    mask = keys.shape[0] - 1
    for i in prange(n):
        qx, qy, qz = queries[i, 0], queries[i, 1], queries[i, 2]
        fx = np.floor((qx - origin[0]) / radius)
        fy = np.floor((qy - origin[1]) / radius)
        fz = np.floor((qz - origin[2]) / radius)
        if min(fx, fy, fz) < -1 or max(fx, fy, fz) > LAST_CELL:
            continue
        ux = qx - origin[0] - fx * radius
        uy = qy - origin[1] - fy * radius
        uz = qz - origin[2] - fz * radius
        best = radius * radius
        row = np.int32(-1)
        for sx in STEPS:
            gx = gap(sx, ux, radius)
            for sy in STEPS:
                gy = gx + gap(sy, uy, radius)
                for sz in STEPS:
                    ix, iy, iz = np.int64(fx) + sx, np.int64(fy) + sy, np.int64(fz) + sz
                    if gy + gap(sz, uz, radius) > best or min(ix, iy, iz) < 0:
                        continue
                    slot = find_slot(keys, cell_key(ix, iy, iz), mask)
                    if keys[slot] == -1:
                        continue
                    cell = slots[slot]
                    for j in range(starts[cell], starts[cell + 1]):
                        dx = points[j, 0] - qx
                        dy = points[j, 1] - qy
                        dz = points[j, 2] - qz
                        d = dx * dx + dy * dy + dz * dz
                        if d < best or (d == best and (row < 0 or j < row)):
                            best = d
                            row = np.int32(j)
        nearest[i] = row
        if row >= 0:
            squared[i] = best
    return nearest, squared


@njit("UniTuple(float32[::1], 2)(float32[:, ::1])", cache=True)
def bounds(points):
    """Lowest and highest coordinates of the points (N, 3); numpy takes ten times as long."""
    low, high = points[0].copy(), points[0].copy()
    for i in range(points.shape[0]):
        for a in range(3):
            low[a] = min(low[a], points[i, a])
            high[a] = max(high[a], points[i, a])
    return low, high
