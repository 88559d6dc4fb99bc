"""Gauss-Newton steps of the robust point-to-plane sum."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.cell_list import CELLS, distance_key, nearest_key
from mpe_core.kernels.energy_descent import solve_cholesky
from mpe_core.kernels.rigid_motion import update_pose

MOVING = "Tuple((float32[:, ::1], float32[:, ::1]))"
"""Points (N, 3), and unit normals (N, 3) that point outwards, or (0, 3) if these are unknown."""
PLANES = "Tuple((float32[:, ::1], float32[:, ::1]))"
"""A point (M, 3) of each plane in the order of the cells, and unit normals (M, 3)."""

POINTS_PER_TASK = 512
"""Points of one pose whose nearest ones one task finds."""


@njit("void(float64[:, ::1], float32[::1], float32[::1])", cache=True)
def _move(T, point, moved):
    """Write the place of a point (3,) at the pose T into moved (3,)."""
    for a in range(3):
        moved[a] = T[a, 0] * point[0] + T[a, 1] * point[1] + T[a, 2] * point[2] + T[a, 3]


@njit(
    f"void(float64[:, :, ::1], int64[::1], int32[:, ::1], float32[:, ::1], float32, {CELLS})",
    cache=True,
    parallel=True,
    error_model="numpy",
)
def find_nearest(poses, rows, nearest, points, reach, cells):
    """Find the column of the cell list next to each point at some of the poses.

    Parameters
    ----------
    poses
        (K, 4, 4) poses.
    rows
        (A,) those that are asked for.
    nearest
        (K, N) takes the columns, -1 beyond reach. It holds those of the last step, or -1, which
        bound the search.
    points
        (N, 3) points that move.
    reach
        Largest distance.
    cells
        Cell list of the fixed cloud, as `CELLS`.
    """
    columns = cells[0]
    none = distance_key(reach * reach)
    count = points.shape[0]
    tasks = (count + POINTS_PER_TASK - 1) // POINTS_PER_TASK
    for task in prange(len(rows) * tasks):
        row = rows[task // tasks]
        first = task % tasks * POINTS_PER_TASK
        moved = np.empty(3, np.float32)
        for i in range(first, min(first + POINTS_PER_TASK, count)):
            _move(poses[row], points[i], moved)
            px, py, pz = moved[0], moved[1], moved[2]
            best = none
            if nearest[row, i] >= 0:
                k = nearest[row, i]
                dx, dy, dz = columns[0, k] - px, columns[1, k] - py, columns[2, k] - pz
                best = min(best, distance_key(dx * dx + dy * dy + dz * dz) | k)
            best = nearest_key(px, py, pz, best, cells)
            nearest[row, i] = np.int32(best & 0x7FFFFFFF) if best < none else np.int32(-1)


@njit("int64[::1](int32[:, ::1], int64[::1], boolean[::1])", cache=True)
def find_unknown(nearest, rows, is_known):
    """Return the (U,) planes, in ascending order, that the rows of `nearest` ask for in vain."""
    is_wanted = np.zeros(len(is_known), np.bool_)
    count = 0
    for row in rows:
        for k in nearest[row]:
            if k >= 0 and not is_known[k] and not is_wanted[k]:
                is_wanted[k] = True
                count += 1
    return np.flatnonzero(is_wanted) if count else np.empty(0, np.int64)


@njit(
    f"void(float64[:, ::1], float64[:, ::1], float64[::1], int32[::1], {MOVING}, {PLANES},"
    " float32)",
    cache=True,
    error_model="numpy",
)
def sum_equations(T, H, g, nearest, moving, planes, cutoff):
    """Sum the normal equations of the points at the pose T into H (6, 6) and g (6,).

    The function is the sum of rho(n.(y - p)) over a small motion p -> p + w x p + v of the moved
    points p, y the point of the plane `nearest` (N,) to each and n its normal, with Tukey's
    biweight rho. Its step (w, v) solves H (w, v) = g.
    """
    points, outward = moving
    feet, normals = planes
    H[:], g[:] = 0.0, 0.0
    J, moved = np.empty(6), np.empty(3, np.float32)
    for i in range(points.shape[0]):
        k = nearest[i]
        if k < 0:
            continue
        if outward.shape[0] > 0:
            facing = 0.0
            for a in range(3):
                facing += normals[k, a] * (
                    T[a, 0] * outward[i, 0] + T[a, 1] * outward[i, 1] + T[a, 2] * outward[i, 2]
                )
            if facing < 0.0:
                continue
        _move(T, points[i], moved)
        px, py, pz = moved[0], moved[1], moved[2]
        nx, ny, nz = normals[k, 0], normals[k, 1], normals[k, 2]
        d = (feet[k, 0] - px) * nx + (feet[k, 1] - py) * ny + (feet[k, 2] - pz) * nz
        u = (d / cutoff) ** 2
        if u < 1.0:
            w = (1.0 - u) * (1.0 - u)
            J[0] = py * nz - pz * ny
            J[1] = pz * nx - px * nz
            J[2] = px * ny - py * nx
            J[3], J[4], J[5] = nx, ny, nz
            for r in range(6):
                wr = w * J[r]
                g[r] += wr * d
                for c in range(6):
                    H[r, c] += wr * J[c]


@njit("void(float64[:, ::1], float64[::1], float64[:, ::1])", cache=True, error_model="numpy")
def solve_allowed(H, g, allowed):
    """Replace g by the step that solves H step = g within the allowed motions, or by zero.

    A share of the trace holds the directions in which the surface slides on itself, and the trace
    those that are not allowed.
    """
    trace = 0.0
    for r in range(6):
        trace += H[r, r]
    A, b = np.empty((6, 6)), np.empty(6)
    half = np.empty((6, 6))
    for r in range(6):
        for c in range(6):
            half[r, c] = 0.0
            for m in range(6):
                half[r, c] += allowed[r, m] * H[m, c]
    for r in range(6):
        b[r] = 0.0
        for c in range(6):
            s = 0.0
            for m in range(6):
                s += half[r, m] * allowed[m, c]
            same = 1.0 if r == c else 0.0
            A[r, c] = s + (same - allowed[r, c]) * trace + same * (1e-9 * trace + 1e-30)
            b[r] += allowed[r, c] * g[c]
    if not solve_cholesky(A, b):
        b[:] = 0.0
    g[:] = b


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
    sizes = np.zeros(len(rows))
    for a in prange(len(rows)):
        row = rows[a]
        H, g = np.empty((6, 6)), np.empty(6)
        sum_equations(poses[row], H, g, nearest[row], moving, planes, cutoffs[a])
        solve_allowed(H, g, allowed)
        update_pose(poses[row], g)
        sizes[a] = np.abs(g).max()
    return sizes
