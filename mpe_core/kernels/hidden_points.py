"""Points of a cloud that others hide, seen from many places."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

ROWS, NO_KEY = np.int64(2**20 - 1), np.int64(2**63 - 1)
"""Bits of a key, range and row of a point in one integer, that hold the row; and key of none."""

PLACE = "float64, float64, float64"


@njit(
    f"void({PLACE}, float64[:, ::1], int64, int32[::1], float64[::1])",
    cache=True,
    error_model="numpy",
)
def look_at(x, y, z, columns, edge, cells, ranges):
    """Write the cells of directions (N,) and ranges (N,) of points as seen from a place.

    The cells lie on a cube, `edge` by `edge` a side.
    """
    # without a branch, so that the compiler uses vectors
    half, last = 0.5 * edge, np.int32(edge - 1)
    for i in range(columns.shape[1]):
        dx, dy, dz = columns[0, i] - x, columns[1, i] - y, columns[2, i] - z
        a, b, c = abs(dx), abs(dy), abs(dz)
        along_x = (a >= b) & (a >= c)
        along_y = (not along_x) & (b >= c)
        length = dx if along_x else (dy if along_y else dz)
        u = dy if along_x else dx
        v = dy if not (along_x | along_y) else dz
        side = (0 if along_x else (2 if along_y else 4)) + (0 if length > 0 else 1)
        length = max(abs(length), 1e-12)
        row = min(np.int32((u / length + 1) * half), last)
        column = min(np.int32((v / length + 1) * half), last)
        cells[i] = np.int32((side * edge + row) * edge + column)
        ranges[i] = np.sqrt(dx * dx + dy * dy + dz * dz)


@njit("int64(int32[::1], float64[::1], float64, float64, int64[::1], int32[::1])", cache=True)
def list_behind(cells, ranges, range_margin, margin, keys, behind):
    """List the points that lie clearly behind the nearest one in their cells.

    Parameters
    ----------
    cells, ranges
        (N,) cells and ranges of the points, see `look_at`.
    range_margin, margin
        As those of `hidden_shares`.
    keys
        (cells,) takes the key of the nearest point in each cell.
    behind
        (N,) takes the rows of the points.

    Returns
    -------
    Their number.
    """
    # branches depend on chance here, and would cost more than the sums
    keys[:] = NO_KEY
    for i in range(len(cells)):
        key = (np.float64(ranges[i]).view(np.int64) & ~ROWS) | i
        keys[cells[i]] = min(keys[cells[i]], key)
    count = 0
    for i in range(len(cells)):
        gap = ranges[i] - ranges[keys[cells[i]] & ROWS]
        behind[count] = i
        count += gap > range_margin * ranges[i] + margin
    return count


@njit(
    "UniTuple(float64[::1], 2)(float64[:, ::1], float64[:, ::1], float64[:, ::1], int64, float64,"
    " float64, float64)",
    cache=True,
    parallel=True,
)
def hidden_shares(places, points, normals, edge, range_margin, margin, slope):
    """Share of the points that are hidden from each place, and of the directions that are seen.

    A point is hidden if another one in its cell of directions lies clearly nearer, and neither lies
    in the plane of the other: far points of one surface share a cell without hiding each other.

    Parameters
    ----------
    places
        (P, 3) places.
    points, normals
        (N, 3) points with unit normals of either sign, up to a million.
    edge
        Cells along a side of the cube of directions.
    range_margin, margin
        Share of the range and length whose sum a nearer point is nearer by, at least.
    slope
        Share of the difference of the ranges that is added to `margin` for a distance from a plane.

    Returns
    -------
    Shares (P,) of the points, and of the cells (P,).
    """
    hidden, seen = np.empty(len(places)), np.empty(len(places))
    columns = points.T.copy()
    for k in prange(len(places)):
        keys, behind = np.empty(6 * edge * edge, np.int64), np.empty(len(points), np.int32)
        cells, ranges = np.empty(len(points), np.int32), np.empty(len(points))
        look_at(places[k, 0], places[k, 1], places[k, 2], columns, edge, cells, ranges)
        found = list_behind(cells, ranges, range_margin, margin, keys, behind)
        count = 0
        for i in behind[:found]:
            j = keys[cells[i]] & ROWS
            off_j, off_i = 0.0, 0.0
            for axis in range(3):
                difference = points[i, axis] - points[j, axis]
                off_j += normals[j, axis] * difference
                off_i += normals[i, axis] * difference
            least = margin + slope * (ranges[i] - ranges[j])
            count += (abs(off_j) > least) & (abs(off_i) > least)
        filled = 0
        for key in keys:
            filled += key < NO_KEY
        hidden[k], seen[k] = count / len(points), filled / len(keys)
    return hidden, seen
