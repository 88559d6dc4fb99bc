"""Sums over the cells of a tree instead of over all pairs (Barnes and Hut 1986); clouds are
(3, count) float32.

The rows of a group share one walk down the tree, so what they meet fills the same vectors as the
exact sum does. A group belongs to one thread: the bits do not depend on their number.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.pair_sum import BLOCK, FAST, ONE, TINY, block_force

GROUP = 32
"""Rows that walk together. 35,947 x 35,947 points, 17 iterations, processor seconds with groups and
leaves of 16 / 32 / 64 points: 0.47 / 0.44 / 0.59; groups of 64 with leaves of 32 0.64."""

HALF, TWO = np.float32(0.5), np.float32(2)
COLUMNS = 10  # of a cell that the far sum reads: centre of mass, mass, second moments
RADIUS = 10
STACK = 64  # one entry a level, and a level halves the points


@njit("UniTuple(f4, 3)(f4, f4, f4, f4, f4[:, ::1], int64)", **FAST)
def _cell_force(x, y, z, eps2, cells, count):
    """Pull of cells on one point: each as its Taylor series about its centre of mass, to second
    order.

    f(d) = g(s) d with s = |d|^2 and g = 1 / (sqrt(s) (s + eps^2)) is the force of one pair; sums
    of it over a cell are mass f + (Q : d d / d^2) f / 2, Q the second moments.
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
    """Centre and radius of the ball around the bounding box of some rows."""
    low, high = x[:, start].copy(), x[:, start].copy()
    for i in range(start, end):
        for a in range(3):
            low[a], high[a] = min(low[a], x[a, i]), max(high[a], x[a, i])
    half, centre = HALF * (high - low), HALF * (high + low)
    return centre[0], centre[1], centre[2], np.sqrt((half * half).sum())


@njit(
    "void(f4[:, ::1], int64, int64, f4[:, ::1], f4[::1], int64[::1], f4[:, ::1], f4, f4,"
    " f8[:, ::1])",
    **FAST,
)
def _group_force(x, start, end, y, mass, starts, cells, eps2, opening, force):
    """Forces on the rows start:end of x."""
    cx, cy, cz, radius = _ball(x, start, end)
    first_leaf = starts.shape[0] - 2
    near, far = np.empty((3, BLOCK), np.float32), np.empty((COLUMNS, BLOCK), np.float32)
    near_mass, weighed = np.empty(min(BLOCK, mass.shape[0]), np.float32), mass.shape[0] > 0
    stack = np.zeros(STACK, np.int64)
    top, points, far_cells = 1, 0, 0
    while top > 0:
        top -= 1
        k = stack[top]
        dx, dy, dz = cells[k, 0] - cx, cells[k, 1] - cy, cells[k, 2] - cz
        distance = np.sqrt(dx * dx + dy * dy + dz * dz) - radius
        if cells[k, RADIUS] < opening * distance:
            far[:, far_cells] = cells[k, :COLUMNS]
            far_cells += 1
        elif k < first_leaf:
            stack[top], stack[top + 1] = 2 * k + 2, 2 * k + 1
            top += 2
        else:
            a, b = starts[k - first_leaf], starts[k - first_leaf + 1]
            near[:, points : points + b - a] = y[:, a:b]
            if weighed:
                near_mass[points : points + b - a] = mass[a:b]
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
                    near_mass[:points],
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


@njit(
    "void(f4[:, ::1], f4[:, ::1], f4[::1], int64[::1], f4[:, ::1], f4, f4, f8[:, ::1])",
    parallel=True,
    **FAST,
)
def tree_force(x, y, mass, starts, cells, eps, opening, force):
    """force[:, i] = -sum_j m_j n_ij / (|x_i - y_j|^2 + eps^2), Eq. 7 with K_i = 1, where a cell
    whose radius is below `opening` times its distance from the rows stands for its points.

    y (3, M) and mass (M,), empty where all m_j are 1, in the order of the tree, whose leaf l holds
    starts[l]:starts[l + 1], at most GROUP points; cells (2 leaves - 1, 11) in the order of a heap:
    centre of mass, mass, second moments about it (xx xy xz yy yz zz), radius. `force` must
    come as zeros.
    """
    count = x.shape[1]
    for group in prange((count + GROUP - 1) // GROUP):
        start = group * GROUP
        _group_force(
            x, start, min(start + GROUP, count), y, mass, starts, cells, eps * eps, opening, force
        )
