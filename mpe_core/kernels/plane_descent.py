"""Point-to-plane steps of many poses at once, each with all its points on one thread."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.cell_list import CELLS, distance_key, nearest_key
from mpe_core.kernels.energy_descent import solve_cholesky
from mpe_core.kernels.plane_equations import add_row
from mpe_core.kernels.rigid_motion import update_pose

MOVING = "Tuple((float32[:, ::1], float32[:, ::1]))"
"""Points (N, 3), and unit normals (N, 3) that point outwards, or (0, 3) if these are unknown."""
PLANES = "Tuple((float32[:, ::1], float32[:, ::1], float32))"
"""Points (M, 3) in the order of the cells, their unit normals (M, 3), and the reach."""
SCHEDULE = "Tuple((float32[::1], float64[::1], int64))"
"""Cut-off and tolerance of each round, and the bound on all steps."""


@njit(
    f"boolean(float64[:, ::1], float32[::1], float64[:, ::1], float64[::1], int32[::1], {MOVING},"
    f" {PLANES}, {CELLS}, float32)",
    cache=True,
    error_model="numpy",
)
def add_equations(T, moved, H, g, nearest, moving, planes, cells, cutoff):
    """Add the normal equations of the point-to-plane sum at the pose T to H and g.

    The sum is that of `plane_equations`. `nearest` (N,) holds the columns of the last step, or -1,
    which bound the search for the next ones, and takes these; `moved` (3,) is scratch.

    Returns
    -------
    Whether any point has a weight.
    """
    points, outward = moving
    fixed, normals, reach = planes
    J, any_weight = np.empty(6), False
    for i in range(points.shape[0]):
        for a in range(3):
            moved[a] = (
                T[a, 0] * points[i, 0] + T[a, 1] * points[i, 1] + T[a, 2] * points[i, 2] + T[a, 3]
            )
        px, py, pz = moved[0], moved[1], moved[2]
        none = best = distance_key(reach * reach)
        if nearest[i] >= 0:
            k = nearest[i]
            dx, dy, dz = fixed[k, 0] - px, fixed[k, 1] - py, fixed[k, 2] - pz
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
        has_weight = add_row(
            (px, py, pz),
            (fixed[k, 0], fixed[k, 1], fixed[k, 2]),
            (normals[k, 0], normals[k, 1], normals[k, 2]),
            cutoff,
            J,
            H,
            g,
        )
        any_weight = any_weight or has_weight
    return any_weight


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
    f"void(float64[:, :, ::1], {MOVING}, {PLANES}, {CELLS}, {SCHEDULE}, float64[:, ::1])",
    cache=True,
    parallel=True,
    error_model="numpy",
)
def descend_on_planes(poses, moving, planes, cells, schedule, allowed):
    """Move poses (K, 4, 4) in place by Gauss-Newton steps of the robust point-to-plane sum.

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
    """
    cutoffs, tolerances, max_steps = schedule
    for k in prange(poses.shape[0]):
        T, moved = poses[k], np.empty(3, np.float32)
        nearest = np.full(moving[0].shape[0], np.int32(-1))
        H, g = np.empty((6, 6)), np.empty(6)
        steps = 0
        for stage in range(cutoffs.shape[0]):
            step = np.inf
            while step >= tolerances[stage] and steps < max_steps:
                H[:], g[:] = 0.0, 0.0
                steps += 1
                if not add_equations(
                    T, moved, H, g, nearest, moving, planes, cells, cutoffs[stage]
                ):
                    break
                solve_allowed(H, g, allowed)
                update_pose(T, g)
                step = np.abs(g).max()
