"""Forces from the cells of a tree instead of from all points (Barnes and Hut 1986).

Clouds are (3, count) float32. The rows of a group share one walk down the tree and collect the
points and cells that they meet into blocks, which are summed as in the exact sum. One thread has a
whole group, so the bits do not depend on the number of threads.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.pair_sum import BLOCK, FAST, ONE, TINY, block_force

TREE = "Tuple((float32[:, ::1], float32[::1], int64[::1], float32[:, ::1]))"
"""Arrays of `paper.barnes_hut_tree.Tree`: points, weights, starts, cells."""

GROUP = 32
"""Rows that walk together, and largest number of points in a leaf (docs/tuning.md)."""

HALF, TWO = np.float32(0.5), np.float32(2)
CELL_COLUMNS = 10
"""Columns of a cell that enter its force: center of mass, weight, second moments."""
RADIUS_COLUMN = 10
"""Column of a cell's radius."""
STACK_SIZE = 64
"""Entries of the stack: one a level, and a level halves the points."""


@njit("UniTuple(f4, 3)(f4, f4, f4, f4, f4[:, ::1], int64)", **FAST)
def _cell_force(x, y, z, eps2, cells, count):
    """Return the force of the first `count` cells on the point (x, y, z).

    The force of one pair is f(d) = g(s) d with s = |d|^2 and g = 1 / (sqrt(s) (s + eps^2)). Its sum
    over a cell is taken as the Taylor series about the center of mass, to second order:
    weight f + (Q : d d / d^2) f / 2, with the second moments Q.
    """
    fx, fy, fz = np.float32(0), np.float32(0), np.float32(0)
    for j in range(count):
        dx, dy, dz = cells[0, j] - x, cells[1, j] - y, cells[2, j] - z
        xx, xy, xz = cells[4, j], cells[5, j], cells[6, j]
        yy, yz, zz = cells[7, j], cells[8, j], cells[9, j]
        s = dx * dx + dy * dy + dz * dz + TINY
        u, v = ONE / (s + eps2), ONE / s
        g = u * np.sqrt(v)
        slope = HALF * v + u  # -g' / g
        bend = slope * slope + HALF * v * v + u * u  # g'' / g
        qx = xx * dx + xy * dy + xz * dz
        qy = xy * dx + yy * dy + yz * dz
        qz = xz * dx + yz * dy + zz * dz
        along = cells[3, j] - slope * (xx + yy + zz) + TWO * bend * (qx * dx + qy * dy + qz * dz)
        across = TWO * slope
        fx += g * (along * dx - across * qx)
        fy += g * (along * dy - across * qy)
        fz += g * (along * dz - across * qz)
    return fx, fy, fz


@njit("Tuple((f4, f4, f4, f4))(f4[:, ::1], int64, int64)", cache=True)
def _ball(x, start, end):
    """Return the center and radius of the ball around the bounding box of the rows start:end."""
    low, high = x[:, start].copy(), x[:, start].copy()
    for i in range(start, end):
        for a in range(3):
            low[a], high[a] = min(low[a], x[a, i]), max(high[a], x[a, i])
    half, center = HALF * (high - low), HALF * (high + low)
    return center[0], center[1], center[2], np.sqrt((half * half).sum())


@njit(
    f"void(f4[:, ::1], int64, int64, {TREE}, f4, f4, f8[:, ::1])",
    **FAST,
)
def _group_force(x, start, end, tree, eps2, opening_ratio, force):
    """Add the forces on the rows start:end of x to `force`."""
    y, weights, starts, cells = tree
    cx, cy, cz, radius = _ball(x, start, end)
    first_leaf = starts.shape[0] - 2
    near, far = np.empty((3, BLOCK), np.float32), np.empty((CELL_COLUMNS, BLOCK), np.float32)
    is_weighted = weights.shape[0] > 0
    near_weights = np.empty(min(BLOCK, weights.shape[0]), np.float32)
    stack = np.zeros(STACK_SIZE, np.int64)
    top, points, far_cells = 1, 0, 0
    while top > 0:
        top -= 1
        k = stack[top]
        dx, dy, dz = cells[k, 0] - cx, cells[k, 1] - cy, cells[k, 2] - cz
        distance = np.sqrt(dx * dx + dy * dy + dz * dz) - radius
        if cells[k, RADIUS_COLUMN] < opening_ratio * distance:
            far[:, far_cells] = cells[k, :CELL_COLUMNS]
            far_cells += 1
        elif k < first_leaf:
            stack[top], stack[top + 1] = 2 * k + 2, 2 * k + 1
            top += 2
        else:
            a, b = starts[k - first_leaf], starts[k - first_leaf + 1]
            near[:, points : points + b - a] = y[:, a:b]
            if is_weighted:
                near_weights[points : points + b - a] = weights[a:b]
            points += b - a
        if points > BLOCK - GROUP or top == 0:
            for i in range(start, end):
                fx, fy, fz = block_force(
                    x[0, i],
                    x[1, i],
                    x[2, i],
                    eps2,
                    near[0, :points],
                    near[1, :points],
                    near[2, :points],
                    near_weights[:points],
                )
                force[0, i] += fx
                force[1, i] += fy
                force[2, i] += fz
            points = 0
        if far_cells == BLOCK or top == 0:
            for i in range(start, end):
                fx, fy, fz = _cell_force(x[0, i], x[1, i], x[2, i], eps2, far, far_cells)
                force[0, i] += fx
                force[1, i] += fy
                force[2, i] += fz
            far_cells = 0


@njit(f"void(f4[:, ::1], {TREE}, f4, f4, f8[:, ::1])", parallel=True, **FAST)
def tree_force(x, tree, eps, opening_ratio, force):
    """Add the forces of a tree's points y_j, with weights w_j, on x (3, N) to force (3, N).

    The sum is that of `pair_force`, except that a cell stands for its points where its radius is
    below `opening_ratio` times its distance from the rows.

    Parameters
    ----------
    x
        (3, N) points; fastest where neighbors follow each other.
    tree
        Points (3, M) in the order of the leaves, weights (M,) or an empty array where all are 1,
        starts (leaves + 1,) of the leaves, at most GROUP points each, and cells (2 leaves - 1, 11)
        in the order of a heap: center of mass, weight, second moments about it (xx xy xz yy yz
        zz), radius.
    eps
        Softening length.
    opening_ratio
        Largest ratio of a cell's radius to its distance at which it stands for its points.
    force
        (3, N) zeros.
    """
    count = x.shape[1]
    for group in prange((count + GROUP - 1) // GROUP):
        start = group * GROUP
        end = min(start + GROUP, count)
        _group_force(x, start, end, tree, eps * eps, opening_ratio, force)
