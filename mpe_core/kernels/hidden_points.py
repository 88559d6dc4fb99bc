"""Points of a cloud that others hide, seen from many places."""

from __future__ import annotations

import numpy as np
from numba import njit, prange


@njit("int64(float64, float64, float64, int64)", cache=True)
def _cube_cell(x, y, z, edge):
    """Return the number of the cell of a direction on a cube of `edge` by `edge` cells a side."""
    a, b, c = abs(x), abs(y), abs(z)
    if a >= b and a >= c:
        length, u, v, side = a, y, z, (0 if x > 0 else 1)
    elif b >= c:
        length, u, v, side = b, x, z, (2 if y > 0 else 3)
    else:
        length, u, v, side = c, x, y, (4 if z > 0 else 5)
    length = max(length, 1e-12)
    row = min(int((u / length + 1) * 0.5 * edge), edge - 1)
    column = min(int((v / length + 1) * 0.5 * edge), edge - 1)
    return (side * edge + row) * edge + column


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
        (N, 3) points with unit normals of either sign.
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
    for k in prange(len(places)):
        nearest = np.full(6 * edge * edge, -1, np.int64)
        cells, ranges = np.empty(len(points), np.int64), np.empty(len(points))
        for i in range(len(points)):
            x = points[i, 0] - places[k, 0]
            y = points[i, 1] - places[k, 1]
            z = points[i, 2] - places[k, 2]
            cell = _cube_cell(x, y, z, edge)
            cells[i], ranges[i] = cell, np.sqrt(x * x + y * y + z * z)
            if nearest[cell] < 0 or ranges[i] < ranges[nearest[cell]]:
                nearest[cell] = i
        count = 0
        for i in range(len(points)):
            j = nearest[cells[i]]
            gap = ranges[i] - ranges[j]
            if gap > range_margin * ranges[i] + margin:
                off_j, off_i = 0.0, 0.0
                for axis in range(3):
                    difference = points[i, axis] - points[j, axis]
                    off_j += normals[j, axis] * difference
                    off_i += normals[i, axis] * difference
                least = margin + slope * gap
                count += abs(off_j) > least and abs(off_i) > least
        filled = 0
        for point in nearest:
            filled += point >= 0
        hidden[k], seen[k] = count / len(points), filled / len(nearest)
    return hidden, seen
