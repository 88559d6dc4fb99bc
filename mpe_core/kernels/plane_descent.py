"""Gauss-Newton steps of the robust point-to-plane sum."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.cell_list import CELLS, from_bits, nearest_of_all, to_bits
from mpe_core.kernels.motion_equations import EQUATION_SUMS
from mpe_core.kernels.plane_equations import (
    MOVING,
    PLANES,
    add_equations,
    move_point,
    solve_allowed,
    sum_equations,
)
from mpe_core.kernels.rigid_motion import update_pose

POINTS_PER_TASK = 512
"""Points of one pose whose nearest ones one task finds."""


@njit(
    "void(float64[:, :, ::1], int64[::1], int32[:, ::1], float32[:, :, ::1], float32[:, ::1],"
    f" float32, {CELLS})",
    cache=True,
    parallel=True,
    error_model="numpy",
)
def find_nearest(poses, rows, nearest, anchors, points, reach, cells):
    """Find the column of the cell list next to each point at some of the poses.

    A point that has moved from where it was looked up by less than half of what its second column
    is farther away than its nearest one keeps that.

    Parameters
    ----------
    poses
        (K, 4, 4) poses.
    rows
        (A,) those that are asked for.
    nearest
        (K, N) takes the columns, -1 beyond reach. It holds those of the last step, or -1, which
        bound the search.
    anchors
        (K, N, 4) takes where each point was looked up, and how far it may go from there. It holds
        those of the last step; less than 0 where none was.
    points
        (N, 3) points that move.
    reach
        Largest distance.
    cells
        Cell list of the fixed cloud, as `CELLS`.
    """
    columns = cells[0]
    none = to_bits(reach * reach)
    count = points.shape[0]
    tasks = (count + POINTS_PER_TASK - 1) // POINTS_PER_TASK
    for task in prange(len(rows) * tasks):
        row = rows[task // tasks]
        first = task % tasks * POINTS_PER_TASK
        moved = np.empty(3, np.float32)
        for i in range(first, min(first + POINTS_PER_TASK, count)):
            move_point(poses[row], points[i], moved)
            px, py, pz = moved[0], moved[1], moved[2]
            anchor = anchors[row, i]
            slack = anchor[3]
            dx, dy, dz = anchor[0] - px, anchor[1] - py, anchor[2] - pz
            if slack > 0 and dx * dx + dy * dy + dz * dz < slack * slack:
                continue
            column, bits = np.int64(nearest[row, i]), none
            if column >= 0:
                dx = columns[0, column] - px
                dy = columns[1, column] - py
                dz = columns[2, column] - pz
                bits = to_bits(dx * dx + dy * dy + dz * dz)
                if bits >= none:
                    column, bits = -1, none
            column, bits, others = nearest_of_all(px, py, pz, column, bits, cells)
            gap = np.sqrt(from_bits(others))
            if column < 0:
                slack = gap - reach
            else:
                slack = 0.5 * (min(gap, reach) - np.sqrt(from_bits(bits)))
            # a little less, since places and distances are rounded
            anchor[3] = 0.99 * slack - 1e-6 * (abs(px) + abs(py) + abs(pz))
            anchor[0], anchor[1], anchor[2] = px, py, pz
            nearest[row, i] = column


@njit("int64[::1](int32[:, ::1], int64[::1], boolean[::1])", cache=True)
def mark_unknown(nearest, rows, is_known):
    """Return the (U,) planes, in ascending order, that the rows of `nearest` ask for in vain.

    From now on they count as known in is_known (M,).
    """
    unknown = np.empty(min(len(rows) * nearest.shape[1], len(is_known)), np.int64)
    count = 0
    for row in rows:
        for k in nearest[row]:
            if k >= 0 and not is_known[k]:
                is_known[k] = True
                unknown[count] = k
                count += 1
    return np.sort(unknown[:count])


@njit(
    f"float64[::1](float64[:, :, ::1], int64[::1], int32[:, ::1], {MOVING}, {PLANES}, float32[::1],"
    " float64[:, ::1])",
    cache=True,
    parallel=True,
    error_model="numpy",
)
def step_on_planes(poses, rows, nearest, moving, planes, cutoffs, allowed):
    """Move some of the poses in place by one Gauss-Newton step.

    Parameters
    ----------
    poses
        (K, 4, 4) poses.
    rows
        (A,) those that move.
    nearest
        (K, N) planes next to the points of each pose, -1 where there is none.
    moving
        Points that move, as `MOVING`.
    planes
        Planes of the fixed cloud, as `PLANES`.
    cutoffs
        (A,) cut-offs of Tukey's biweight.
    allowed
        (6, 6) projector on the small motions that are allowed.

    Returns
    -------
    (A,) largest component of each step.
    """
    tasks = (len(moving[0]) + POINTS_PER_TASK - 1) // POINTS_PER_TASK
    parts = np.empty((len(rows), tasks, EQUATION_SUMS))
    for task in prange(len(rows) * tasks):
        a, part = task // tasks, task % tasks
        first, row = part * POINTS_PER_TASK, rows[a]
        last = min(first + POINTS_PER_TASK, len(moving[0]))
        sum_equations(
            poses[row], nearest[row], moving, planes, cutoffs[a], first, last, parts[a, part]
        )
    sizes = np.zeros(len(rows))
    for a in prange(len(rows)):
        H, g = add_equations(parts[a])
        solve_allowed(H, g, allowed)
        update_pose(poses[rows[a]], g)
        sizes[a] = np.abs(g).max()
    return sizes


@njit(
    f"float64[:, ::1](float64[:, :, ::1], int32[:, ::1], {MOVING}, {PLANES}, float32)",
    cache=True,
    parallel=True,
)
def sum_gradients(poses, nearest, moving, planes, cutoff):
    """Sum the right sides g of the normal equations, see `sum_equations`, at some poses.

    Parameters
    ----------
    poses
        (K, 4, 4) poses.
    nearest, moving, planes
        As those of `step_on_planes`.
    cutoff
        Cut-off of Tukey's biweight.

    Returns
    -------
    (K, 6) the sums, rotation before translation.
    """
    sums = np.empty((len(poses), EQUATION_SUMS))
    for row in prange(len(poses)):
        sum_equations(
            poses[row], nearest[row], moving, planes, cutoff, 0, len(moving[0]), sums[row]
        )
    return sums[:, EQUATION_SUMS - 6 :].copy()
