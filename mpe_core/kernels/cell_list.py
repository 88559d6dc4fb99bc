"""Cell lists: points hashed into cubic cells, for queries within a distance.

The tuple types of this module are the arguments of all kernels that work on cells:

- `GRID`: origin (3,) and edge of the cells.
- `TABLE`: open-addressing hash table, `keys` (slots,) a cell key or -1, and `numbers` (slots,) the
  number of that cell.
- `CELLS`: a whole cell list, the points' `columns` (3, N) and `starts` (cells + 1,), followed by
  the table and the grid (flat, because numba passes no nested tuples to threads). Cell c holds the
  columns starts[c]:starts[c + 1]. Cells that follow each other along z are neighbors in memory, so
  the points of three such cells are one run of columns, a loop that the compiler turns into vector
  instructions.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

GRID = "Tuple((float32[::1], float32))"
"""Origin (3,) and edge."""
TABLE = "Tuple((int64[::1], int32[::1]))"
"""Keys and numbers."""
CELLS = "Tuple((float32[:, ::1], int32[::1], int64[::1], int32[::1], float32[::1], float32))"
"""Columns, starts, keys, numbers, origin and edge."""

MAX_CELL_INDEX = 2**21 - 2
"""Largest index of a cell along an axis: a key holds 21 bits an axis."""

QUERY, COLUMNS = "float32, float32, float32", "float32[::1], float32[::1], float32[::1]"
"""Coordinates of a query, and of points."""
FARTHEST = np.int32(0x7F7FFFFF)
"""Bits of the largest squared distance, see `to_bits`."""

NEIGHBOR_STEPS = (0, -1, 1)
"""Steps along an axis; the middle cell first, whose points rule out most of the others."""


@njit("int64(int64, int64, int64)", cache=True, inline="always")
def cell_key(ix, iy, iz):
    """Pack three indices of up to 21 bits into one key."""
    return (ix << 42) | (iy << 21) | iz


@njit("int64(int64, int64)", cache=True, inline="always")
def hash_slot(key, mask):
    """Return the first slot to look at; eight cells along z share a cache line."""
    h = (key >> 3) * np.int64(-7046029254386353131)
    h ^= h >> 32
    h *= np.int64(-4417276706812531889)
    return (((h ^ (h >> 29)) << 3) | (key & 7)) & mask


@njit("int64(int64[::1], int64, int64)", cache=True, inline="always")
def find_slot(keys, key, mask):
    """Return the slot that holds the key, or the free slot where it belongs."""
    slot = hash_slot(key, mask)
    while keys[slot] != -1 and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@njit(
    f"UniTuple(float32, 6)(float32, float32, float32, {CELLS})",
    cache=True,
    inline="always",
)
def locate(x, y, z, cells):
    """Return the cell (fx, fy, fz) of a point and the point's offset (ux, uy, uz) in it.

    The indices are floats: those of a point far from the grid do not fit an integer.
    """
    origin, size = cells[4], cells[5]
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
def squared_gap(step, inside, size):
    """Return the squared distance along an axis from a point to the cell `step` cells away.

    `inside` is the point's offset in its own cell. The result is 0.1 % too small, because points
    are numbered in rounded arithmetic.
    """
    d = np.float32(0.999) * (inside if step < 0 else size - inside)
    return np.float32(0.0) if step == 0 else d * d


@njit(
    f"UniTuple(int64, 2)(UniTuple(float32, 6), int64, int64, float32, {CELLS})",
    cache=True,
    inline="always",
)
def column_run(place, step_x, step_y, limit, cells):
    """Return the run first:last of columns in three cells along z around a place.

    Parameters
    ----------
    place
        Cell and offset of the query, as `locate` returns them.
    step_x, step_y
        Steps from the query's cell to the middle one of the three.
    limit
        Squared distance from the query; cells beyond it are left out.

    Returns
    -------
    (first, last), equal where no cell is left.
    """
    _, starts, keys, numbers, _, size = cells
    ix, iy, iz = np.int64(place[0]) + step_x, np.int64(place[1]) + step_y, np.int64(place[2])
    rest = limit - (squared_gap(step_x, place[3], size) + squared_gap(step_y, place[4], size))
    first = last = 0
    if rest >= 0 and min(ix, iy) >= 0:
        for step in range(-1, 2):
            if iz + step < 0 or squared_gap(step, place[5], size) > rest:
                continue
            slot = find_slot(keys, cell_key(ix, iy, iz + step), keys.shape[0] - 1)
            if keys[slot] != -1:
                first = first if last else starts[numbers[slot]]
                last = starts[numbers[slot] + 1]
    return first, last


@njit("int32(float32)", cache=True, inline="always")
def to_bits(squared):
    """Return the bits of a squared distance: integers in the same order.

    The compiler turns a minimum of integers into vector instructions, but not a minimum of floats.
    """
    return np.float32(squared).view(np.int32)


@njit("float32(int32)", cache=True, inline="always")
def from_bits(bits):
    """Return the squared distance with these bits."""
    return np.int32(bits).view(np.float32)


@njit(f"int32({QUERY}, int64, {COLUMNS})", cache=True)
def least_of_others(qx, qy, qz, left_out, px, py, pz):
    """Return the bits of the least squared distance from a query to the points px, py, pz.

    The point of the row `left_out` is none of them; -1 leaves out none.
    """
    row, best = np.int32(left_out), FARTHEST
    for j in range(px.shape[0]):
        dx, dy, dz = px[j] - qx, py[j] - qy, pz[j] - qz
        bits = to_bits(dx * dx + dy * dy + dz * dz)
        best = min(best, FARTHEST if np.int32(j) == row else bits)
    return best


# no fastmath in these two: both have to round a distance alike
@njit(f"int64({QUERY}, int32, {COLUMNS})", cache=True)
def first_at(qx, qy, qz, bits, px, py, pz):
    """Return the first row of px, py, pz at the squared distance with these bits."""
    first = FARTHEST
    for j in range(px.shape[0]):
        dx, dy, dz = px[j] - qx, py[j] - qy, pz[j] - qz
        is_there = to_bits(dx * dx + dy * dy + dz * dz) == bits
        first = min(first, np.int32(j) if is_there else FARTHEST)
    return first


@njit(f"Tuple((int64, int32))({QUERY}, int64, int32, {CELLS})", cache=True)
def nearest_point(qx, qy, qz, column, bits, cells):
    """Find the nearest point to a query.

    Parameters
    ----------
    qx, qy, qz
        The query.
    column, bits
        Column of a point, and the bits of its squared distance; or -1, and those of the largest
        distance that is asked for, at most the edge of the cells.
    cells
        Cell list, as `CELLS`.

    Returns
    -------
    Column and bits of the nearest point: those that are given unless another one is nearer.
    """
    place = locate(qx, qy, qz, cells)
    if min(place[0], place[1], place[2]) < -1:
        return column, bits
    if max(place[0], place[1], place[2]) > MAX_CELL_INDEX:
        return column, bits
    x, y, z = cells[0][0], cells[0][1], cells[0][2]
    first = last = 0
    for sx in NEIGHBOR_STEPS:
        for sy in NEIGHBOR_STEPS:
            a, b = column_run(place, sx, sy, from_bits(bits), cells)
            if a < b:
                least = least_of_others(qx, qy, qz, -1, x[a:b], y[a:b], z[a:b])
                if least < bits:
                    bits, first, last = least, a, b
    if last:
        run = x[first:last], y[first:last], z[first:last]
        column = first + first_at(qx, qy, qz, bits, *run)
    return column, bits


@njit(f"Tuple((int64, int32, int32))({QUERY}, int64, int32, {CELLS})", cache=True)
def nearest_of_all(qx, qy, qz, column, bits, cells):
    """Find the nearest point to a query, and how near others may be.

    Parameters
    ----------
    qx, qy, qz, column, bits, cells
        As those of `nearest_point`.

    Returns
    -------
    Column and bits of the nearest point, as those of `nearest_point`, and bits of a squared
    distance within which no other point lies.
    """
    place, size = locate(qx, qy, qz, cells), cells[5]
    others = to_bits(np.float32(0.998) * size * size)
    if min(place[0], place[1], place[2]) < -1:
        return column, bits, others
    if max(place[0], place[1], place[2]) > MAX_CELL_INDEX:
        return column, bits, others
    x, y, z = cells[0][0], cells[0][1], cells[0][2]
    first = last = 0
    for sx in NEIGHBOR_STEPS:
        for sy in NEIGHBOR_STEPS:
            limit = from_bits(bits)
            gap = squared_gap(sx, place[3], size) + squared_gap(sy, place[4], size)
            if gap > limit:
                others = min(others, to_bits(gap))
                continue
            for sz in NEIGHBOR_STEPS:
                beside = gap + squared_gap(sz, place[5], size)
                if beside > limit:
                    others = min(others, to_bits(beside))
            a, b = column_run(place, sx, sy, limit, cells)
            if a < b:
                least = least_of_others(qx, qy, qz, column - a, x[a:b], y[a:b], z[a:b])
                if least < bits:
                    if last or column >= 0:
                        others = min(others, bits)
                    bits, first, last = least, a, b
                else:
                    others = min(others, least)
    if last:
        run = x[first:last], y[first:last], z[first:last]
        row = first_at(qx, qy, qz, bits, *run)
        others = min(others, least_of_others(qx, qy, qz, row, *run))
        column = first + row
    return column, bits, others


@njit(
    f"Tuple((int32[::1], float32[::1]))(float32[:, ::1], float32, {CELLS})",
    cache=True,
    parallel=True,
)
def nearest_within(queries, reach, cells):
    """Find the nearest point closer than `reach` to each query (N, 3).

    Parameters
    ----------
    queries
        (N, 3) places.
    reach
        Largest distance, at most the edge of the cells.
    cells
        Cell list of M points, as `CELLS`.

    Returns
    -------
    (N,) column of the nearest point, or -1; of equally near points the first column.
    (N,) squared distance, or infinity.
    """
    n = queries.shape[0]
    nearest = np.full(n, np.int32(-1))
    squared = np.full(n, np.float32(np.inf))
    none = to_bits(reach * reach)
    for i in prange(n):
        x, y, z = queries[i, 0], queries[i, 1], queries[i, 2]
        column, bits = nearest_point(x, y, z, -1, none, cells)
        nearest[i] = column
        if column >= 0:
            squared[i] = from_bits(bits)
    return nearest, squared
