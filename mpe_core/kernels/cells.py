"""Cell lists: points hashed into cubes, for thinning and nearest points.

A grid is four arrays: `keys` (table,) int64 cell key or -1, `slots` (table,) int32 cell number,
`starts` (cells + 1,) int32, and the points' `columns` (3, N), reordered so that cell c holds
starts[c]:starts[c+1]. Cells are ordered by their keys: those along z follow each other, and what
lies in three of them is one run of columns, which the compiler turns into vectors.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

F32 = np.float32
LAST_CELL = 2**21 - 2
"""A key holds 21 bits an axis."""

FIRST_TABLE = 2**12
"""Slots of a table to begin with; it stays at most half full, and small enough for the processor's
cache where the cells are few."""


@njit("int64(int64, int64, int64)", cache=True, inline="always")
def cell_key(ix, iy, iz):
    return (ix << 42) | (iy << 21) | iz


@njit("int64(int64, int64)", cache=True, inline="always")
def hash_slot(key, mask):
    """Where to look first: eight cells along z share a line of the processor's cache."""
    h = (key >> 3) * np.int64(-7046029254386353131)
    h ^= h >> 32
    h *= np.int64(-4417276706812531889)
    return (((h ^ (h >> 29)) << 3) | (key & 7)) & mask


@njit("int64(int64[::1], int64, int64)", cache=True, inline="always")
def find_slot(keys, key, mask):
    """Slot that holds the key, or the free slot where it belongs."""
    slot = hash_slot(key, mask)
    while keys[slot] != -1 and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@njit("Tuple((int64[::1], int32[::1]))(int64[::1], int32[::1])", cache=True)
def doubled(keys, slots):
    """The table in twice its size."""
    larger = np.full(2 * keys.shape[0], np.int64(-1))
    numbers = np.empty(larger.shape[0], np.int32)
    for old in range(keys.shape[0]):
        if keys[old] != -1:
            slot = find_slot(larger, keys[old], larger.shape[0] - 1)
            larger[slot] = keys[old]
            numbers[slot] = slots[old]
    return larger, numbers


@njit(
    "UniTuple(int64, 2)(float32[:, ::1], float32[::1], float32, int64[::1], int32[::1], int32[::1],"
    " int32[::1], int64, int64)",
    cache=True,
)
def number_until_half_full(points, origin, size, keys, slots, cell_of, counts, i, cells):
    """Number the cells of the points from row i on until the table is half full: (next row, number
    of cells)."""
    inverse = np.float32(1.0) / size
    mask = keys.shape[0] - 1
    while i < points.shape[0] and 2 * cells <= mask:
        key = cell_key(
            np.int64((points[i, 0] - origin[0]) * inverse),
            np.int64((points[i, 1] - origin[1]) * inverse),
            np.int64((points[i, 2] - origin[2]) * inverse),
        )
        slot = find_slot(keys, key, mask)
        if keys[slot] == -1:
            keys[slot] = key
            slots[slot] = cells
            cells += 1
        cell_of[i] = slots[slot]
        counts[slots[slot]] += 1
        i += 1
    return i, cells


@njit(
    "Tuple((int64[::1], int32[::1], int32[::1], int32[::1]))"
    "(float32[:, ::1], float32[::1], float32)",
    cache=True,
)
def number_cells(points, origin, size):
    """Number the occupied cells in order of first appearance: (keys, slots, cell of point,
    counts)."""
    n = points.shape[0]
    keys = np.full(FIRST_TABLE, np.int64(-1))
    slots = np.empty(FIRST_TABLE, np.int32)
    cell_of = np.empty(n, np.int32)
    counts = np.zeros(n, np.int32)
    i, cells = number_until_half_full(points, origin, size, keys, slots, cell_of, counts, 0, 0)
    while i < n:
        keys, slots = doubled(keys, slots)
        i, cells = number_until_half_full(
            points, origin, size, keys, slots, cell_of, counts, i, cells
        )
    return keys, slots, cell_of, counts[:cells]


@njit("int64[::1](int64[::1], int32[::1], int64)", cache=True)
def keys_of_cells(keys, slots, cells):
    """(cells,) key of each numbered cell."""
    found = np.empty(cells, np.int64)
    for slot in range(keys.shape[0]):
        if keys[slot] != -1:
            found[slots[slot]] = keys[slot]
    return found


@njit(
    "UniTuple(int32[::1], 2)(int64[::1], int32[::1], int32[::1], int32[::1], int64[::1])",
    cache=True,
)
def sort_by_cell(keys, slots, cell_of, counts, order):
    """Points in the `order` of cells, whose numbers in `slots` become their places in it: (starts,
    original row of each column)."""
    cells = counts.shape[0]
    rank = np.empty(cells, np.int32)
    starts = np.zeros(cells + 1, np.int32)
    for c in range(cells):
        rank[order[c]] = c
        starts[c + 1] = starts[c] + counts[order[c]]
    for slot in range(keys.shape[0]):
        if keys[slot] != -1:
            slots[slot] = rank[slots[slot]]
    place = starts[:-1].copy()
    rows = np.empty(cell_of.shape[0], np.int32)
    for i in range(cell_of.shape[0]):
        cell = rank[cell_of[i]]
        rows[place[cell]] = i
        place[cell] += 1
    return starts, rows


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


@njit(
    "UniTuple(float32, 6)(float32, float32, float32, float32[::1], float32)",
    cache=True,
    inline="always",
)
def cell_around(x, y, z, origin, size):
    """The cell that holds a point, and where in it the point lies: (fx, fy, fz, ux, uy, uz); not
    yet whole numbers, because a point far off has none."""
    fx = np.floor((x - origin[0]) / size)
    fy = np.floor((y - origin[1]) / size)
    fz = np.floor((z - origin[2]) / size)
    return (
        fx,
        fy,
        fz,
        x - origin[0] - fx * size,
        y - origin[1] - fy * size,
        z - origin[2] - fz * size,
    )


@njit("float32(int64, float32, float32)", cache=True, inline="always")
def gap(step, inside, size):
    """Squared distance along one axis to the cell a step away, from `inside` the middle one; a
    little less, because points are numbered in rounded arithmetic."""
    d = np.float32(0.999) * (inside if step < 0 else size - inside)
    return np.float32(0.0) if step == 0 else d * d


@njit(
    "UniTuple(int64, 2)(int64, int64, int64, float32, float32, float32, int64[::1], int32[::1],"
    " int32[::1])",
    cache=True,
    inline="always",
)
def run(ix, iy, iz, inside, size, limit, keys, slots, starts):
    """Columns first:last of the cell and its two neighbours along z, but those whose squared
    distance along z is beyond the limit."""
    first = last = 0
    for step in range(-1, 2):
        if iz + step < 0 or gap(step, inside, size) > limit:
            continue
        slot = find_slot(keys, cell_key(ix, iy, iz + step), keys.shape[0] - 1)
        if keys[slot] != -1:
            first = first if last else starts[slots[slot]]
            last = starts[slots[slot] + 1]
    return first, last


@njit(
    "float32(float32, float32, float32, float32, float32[::1], float32[::1], float32[::1])",
    cache=True,
    fastmath=True,
)
def least_squared(qx, qy, qz, best, px, py, pz):
    """The least squared distance from the query, or `best` if that is less."""
    for j in range(px.shape[0]):
        dx, dy, dz = px[j] - qx, py[j] - qy, pz[j] - qz
        best = min(best, dx * dx + dy * dy + dz * dz)
    return best


@njit(
    "int32(float32, float32, float32, float32, float32[::1], float32[::1], float32[::1])",
    cache=True,
    fastmath=True,
)
def first_as_near(qx, qy, qz, best, px, py, pz):
    """The first column whose squared distance from the query is `best`, but for rounding."""
    limit = best * F32(1.000001) + F32(1e-30)
    first = none = np.int32(px.shape[0])
    # no way out of the loop, so that the compiler turns it into vectors
    for j in range(px.shape[0]):
        dx, dy, dz = px[j] - qx, py[j] - qy, pz[j] - qz
        first = min(first, np.int32(j) if dx * dx + dy * dy + dz * dz <= limit else none)
    return first


@njit(
    "Tuple((int32[::1], float32[::1]))"
    "(float32[:, ::1], float32, float32[:, ::1], int32[::1], int64[::1], int32[::1], float32[::1],"
    " float32)",
    cache=True,
    parallel=True,
)
def nearest_within(queries, reach, columns, starts, keys, slots, origin, size):
    """Column of the nearest point within `reach` (at most the cell size) of each query, or -1, and
    the squared distance."""
    n = queries.shape[0]
    nearest = np.full(n, np.int32(-1))
    squared = np.full(n, np.float32(np.inf))
    x, y, z = columns[0], columns[1], columns[2]
    for i in prange(n):
        qx, qy, qz = queries[i, 0], queries[i, 1], queries[i, 2]
        fx, fy, fz, ux, uy, uz = cell_around(qx, qy, qz, origin, size)
        if min(fx, fy, fz) < -1 or max(fx, fy, fz) > LAST_CELL:
            continue
        best = reach * reach
        first = last = 0
        for sx in STEPS:
            gx = gap(sx, ux, size)
            for sy in STEPS:
                gy = gx + gap(sy, uy, size)
                ix, iy = np.int64(fx) + sx, np.int64(fy) + sy
                if gy > best or min(ix, iy) < 0:
                    continue
                a, b = run(ix, iy, np.int64(fz), uz, size, best - gy, keys, slots, starts)
                least = least_squared(qx, qy, qz, best, x[a:b], y[a:b], z[a:b])
                if least < best:
                    best, first, last = least, a, b
        if last > first:
            column = first_as_near(qx, qy, qz, best, x[first:last], y[first:last], z[first:last])
            nearest[i], squared[i] = np.int32(first) + column, best
    return nearest, squared
