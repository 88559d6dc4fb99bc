"""Nearest point of a mesh, by a tree of boxes around its triangles.

Box i, from 1, holds boxes 2 i and 2 i + 1; the last half of the boxes are the leaves, each around
`LEAF_TRIANGLES` consecutive triangles. Boxes of leaves without triangles are infinitely far.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

LEAF_TRIANGLES = 4
"""Triangles of a leaf: about as long to test as the boxes above them."""
_MAX_WAITING = 64
"""Boxes that wait while a branch is followed: one a level, of at most 2^63 leaves."""


@njit(
    "UniTuple(float64, 5)(float64, float64, float64, float64[::1])",
    cache=True,
    error_model="numpy",
)
def nearest_in_triangle(px, py, pz, t):
    """Find the point of a triangle (a, b, c) that is nearest to p (Ericson 2004, 5.1.5).

    Returns
    -------
    Its coordinates, the squared distance, and where it lies: 0 inside, 1 to 3 on the edges ab,
    bc, ca, 4 to 6 at a, b, c.
    """
    ax, ay, az = px - t[0], py - t[1], pz - t[2]
    ux, uy, uz = t[3] - t[0], t[4] - t[1], t[5] - t[2]
    vx, vy, vz = t[6] - t[0], t[7] - t[1], t[8] - t[2]
    bx, by, bz = px - t[3], py - t[4], pz - t[5]
    cx, cy, cz = px - t[6], py - t[7], pz - t[8]
    d1, d2 = ux * ax + uy * ay + uz * az, vx * ax + vy * ay + vz * az
    d3, d4 = ux * bx + uy * by + uz * bz, vx * bx + vy * by + vz * bz
    d5, d6 = ux * cx + uy * cy + uz * cz, vx * cx + vy * cy + vz * cz
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0 and d2 <= 0:
        s, w, place = 0.0, 0.0, 4.0
    elif d3 >= 0 and d4 <= d3:
        s, w, place = 1.0, 0.0, 5.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        s, w, place = d1 / (d1 - d3), 0.0, 1.0
    elif d6 >= 0 and d5 <= d6:
        s, w, place = 0.0, 1.0, 6.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        s, w, place = 0.0, d2 / (d2 - d6), 3.0
    elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        s, place = 1.0 - w, 2.0
    else:
        whole = va + vb + vc
        s, w, place = vb / whole, vc / whole, 0.0
    x, y, z = t[0] + s * ux + w * vx, t[1] + s * uy + w * vy, t[2] + s * uz + w * vz
    squared = (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2
    return x, y, z, squared, place


@njit("float64(float64, float64, float64, float64[::1])", cache=True, inline="always")
def _squared_to_box(px, py, pz, box):
    dx = max(box[0] - px, 0.0, px - box[3])
    dy = max(box[1] - py, 0.0, py - box[4])
    dz = max(box[2] - pz, 0.0, pz - box[5])
    return dx * dx + dy * dy + dz * dz


@njit(
    "Tuple((float64[:, ::1], int64[::1], int64[::1]))"
    "(float64[:, ::1], float64[:, ::1], float64[:, ::1])",
    parallel=True,
    cache=True,
)
def nearest_in_mesh(points, triangles, boxes):
    """Find the nearest point of a mesh for each of many points.

    Parameters
    ----------
    points
        (N, 3).
    triangles
        (F, 9) corners, in the order of the leaves.
    boxes
        (2 L, 6) lower and upper corner of each box; L leaves.

    Returns
    -------
    (N, 3) nearest points, (N,) rows of their triangles, and (N,) where they lie in them, as
    `nearest_in_triangle` says.
    """
    count, leaves = len(points), len(boxes) // 2
    nearest = np.empty((count, 3))
    rows, places = np.empty(count, np.int64), np.empty(count, np.int64)
    for i in prange(count):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        waiting = np.empty(_MAX_WAITING, np.int64)
        waiting[0] = 1
        length, best = 1, np.inf
        row, place, nx, ny, nz = -1, 0, 0.0, 0.0, 0.0
        while length > 0:
            length -= 1
            box = waiting[length]
            if _squared_to_box(px, py, pz, boxes[box]) >= best:
                continue
            if box >= leaves:
                start = (box - leaves) * LEAF_TRIANGLES
                for j in range(start, min(start + LEAF_TRIANGLES, len(triangles))):
                    x, y, z, squared, where = nearest_in_triangle(px, py, pz, triangles[j])
                    if squared < best:
                        best, row, place = squared, j, int(where)
                        nx, ny, nz = x, y, z
                continue
            first, second = 2 * box, 2 * box + 1
            near = _squared_to_box(px, py, pz, boxes[first])
            far = _squared_to_box(px, py, pz, boxes[second])
            if far < near:
                first, second = second, first
            waiting[length], waiting[length + 1] = second, first
            length += 2
        nearest[i, 0], nearest[i, 1], nearest[i, 2] = nx, ny, nz
        rows[i], places[i] = row, place
    return nearest, rows, places
