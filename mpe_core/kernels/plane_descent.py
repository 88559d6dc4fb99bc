"""Gauss-Newton steps of the robust point-to-plane sum, each pose on one thread."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.cell_list import CELLS, distance_key, nearest_key
from mpe_core.kernels.energy_descent import solve_cholesky
from mpe_core.kernels.rigid_motion import update_pose

MOVING = "Tuple((float32[:, ::1], float32[:, ::1]))"
"""Points (N, 3), and unit normals (N, 3) that point outwards, or (0, 3) if these are unknown."""
PLANES = "Tuple((float32[:, ::1], float32[:, ::1], float32))"
"""A point (M, 3) of each plane in the order of the cells, unit normals (M, 3), and the reach."""
SCHEDULE = "Tuple((float32[::1], float64[::1], int64))"
"""Cut-off and tolerance of each round, and the bound on all steps."""


@njit(
    f"void(float64[:, ::1], float64[:, ::1], float64[::1], int32[::1], {MOVING}, {PLANES}, {CELLS},"
    " float32)",
    cache=True,
    error_model="numpy",
)
def sum_equations(T, H, g, nearest, moving, planes, cells, cutoff):
    """Sum the normal equations of the points at the pose T into H (6, 6) and g (6,).

    The function is the sum of rho(n.(y - p)) over a small motion p -> p + w x p + v of the moved
    points p, y the plane's point next to each and n its normal, with Tukey's biweight rho. Its step
    (w, v) solves H (w, v) = g. `nearest` (n,) holds the columns of the last step, or -1, which
    bound the search for the next ones, and takes these.
    """
    points, outward = moving
    feet, normals, reach = planes
    columns = cells[0]
    H[:], g[:] = 0.0, 0.0
    J, moved = np.empty(6), np.empty(3, np.float32)
    none = distance_key(reach * reach)
    for i in range(points.shape[0]):
        for a in range(3):
            moved[a] = (
                T[a, 0] * points[i, 0] + T[a, 1] * points[i, 1] + T[a, 2] * points[i, 2] + T[a, 3]
            )
        px, py, pz = moved[0], moved[1], moved[2]
        best = none
        if nearest[i] >= 0:
            k = nearest[i]
            dx, dy, dz = columns[0, k] - px, columns[1, k] - py, columns[2, k] - pz
            best = min(best, distance_key(dx * dx + dy * dy + dz * dz) | k)
        best = nearest_key(px, py, pz, best, cells)
        nearest[i] = -1
        if best >= none:
            continue
        k = np.int32(best & 0x7FFFFFFF)
        nearest[i] = k
        if outward.shape[0] > 0:
            facing = 0.0
            for a in range(3):
                facing += normals[k, a] * (
                    T[a, 0] * outward[i, 0] + T[a, 1] * outward[i, 1] + T[a, 2] * outward[i, 2]
                )
            if facing < 0.0:
                continue
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
    f"Tuple((int64[::1], boolean[::1]))(float64[:, :, ::1], {MOVING}, {PLANES}, {CELLS},"
    f" {SCHEDULE}, float64[:, ::1])",
    cache=True,
    parallel=True,
    error_model="numpy",
)
def descend_on_planes(poses, moving, planes, cells, schedule, allowed):
    """Move poses (K, 4, 4) in place by Gauss-Newton steps.

    Parameters
    ----------
    poses
        (K, 4, 4) starts, which become the ends.
    moving
        Points that move, as `MOVING`.
    planes
        Planes of the fixed cloud, as `PLANES`.
    cells
        Cell list of the fixed cloud, as `CELLS`.
    schedule
        Rounds of steps, as `SCHEDULE`; a round ends with a step below its tolerance.
    allowed
        (6, 6) projector on the small motions that are allowed.

    Returns
    -------
    (K,) steps taken, and (K,) whether the last round ended.
    """
    cutoffs, tolerances, max_steps = schedule
    steps = np.zeros(len(poses), np.int64)
    has_ended = np.zeros(len(poses), np.bool_)
    for k in prange(len(poses)):
        nearest = np.full(len(moving[0]), np.int32(-1))
        H, g = np.empty((6, 6)), np.empty(6)
        stage = 0
        while stage < len(cutoffs) and steps[k] < max_steps:
            sum_equations(poses[k], H, g, nearest, moving, planes, cells, cutoffs[stage])
            solve_allowed(H, g, allowed)
            update_pose(poses[k], g)
            steps[k] += 1
            if np.abs(g).max() < tolerances[stage]:
                stage += 1
        has_ended[k] = stage == len(cutoffs)
    return steps, has_ended
