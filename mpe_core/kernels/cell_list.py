"""Cell lists: points hashed into cubes, asked for nearest points.

A list is four arrays: `keys` (table,) int64 cell key or -1, `slots` (table,) int32 cell number,
`starts` (cells + 1,) int32, and the points' `columns` (3, N), reordered so that cell c holds
starts[c]:starts[c+1]. Cells along z follow each other: what lies in three of them is one run of
columns, which the compiler turns into vectors.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

LAST_CELL = 2**21 - 2
"""A key holds 21 bits an axis."""


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


@njit("int64(float32)", cache=True, inline="always")
def distance_key(squared):
    """A squared distance as the upper half of a whole number, in the same order."""
    return np.int64(np.float32(squared).view(np.int32)) << 32


@njit(
    "int64(float32, float32, float32, int64, float32[::1], float32[::1], float32[::1], int64)",
    cache=True,
    fastmath=True,
)
def least_key(qx, qy, qz, best, px, py, pz, first):
    """The least distance key with its column, counted from `first`, in the lower half; or `best` if
    that is less. The compiler turns a minimum of whole numbers into vectors, of floats not."""
    for j in range(px.shape[0]):
        dx, dy, dz = px[j] - qx, py[j] - qy, pz[j] - qz
        best = min(best, distance_key(dx * dx + dy * dy + dz * dz) | (first + j))
    return best


@njit(
    "Tuple((int32[::1], float32[::1]))"
    "(float32[:, ::1], float32, float32[:, ::1], int32[::1], int64[::1], int32[::1], float32[::1],"
    " float32)",
    cache=True,
    parallel=True,
)
def nearest_within(queries, reach, columns, starts, keys, slots, origin, size):
    """Column of the nearest point closer than `reach` (at most the cell size) to each query, or -1,
    and the squared distance; of equally near ones the first column."""
    n = queries.shape[0]
    nearest = np.full(n, np.int32(-1))
    squared = np.full(n, np.float32(np.inf))
    x, y, z = columns[0], columns[1], columns[2]
    for i in prange(n):
        qx, qy, qz = queries[i, 0], queries[i, 1], queries[i, 2]
        fx, fy, fz, ux, uy, uz = cell_around(qx, qy, qz, origin, size)
        if min(fx, fy, fz) < -1 or max(fx, fy, fz) > LAST_CELL:
            continue
        limit = reach * reach
        none = best = distance_key(limit)
        for sx in STEPS:
            gx = gap(sx, ux, size)
            for sy in STEPS:
                gy = gx + gap(sy, uy, size)
                ix, iy = np.int64(fx) + sx, np.int64(fy) + sy
                if gy > limit or min(ix, iy) < 0:
                    continue
                a, b = run(ix, iy, np.int64(fz), uz, size, limit - gy, keys, slots, starts)
                best = least_key(qx, qy, qz, best, x[a:b], y[a:b], z[a:b], a)
                limit = np.int32(best >> 32).view(np.float32)
        if best < none:
            nearest[i], squared[i] = np.int32(best & 0x7FFFFFFF), limit
    return nearest, squared
