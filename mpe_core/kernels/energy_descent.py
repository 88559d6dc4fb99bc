"""Descent of many poses at once on the P2 energy.

Each pose compares one small sample of the source with the target's nearest points, which it reads
from a lattice.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.motion_equations import (
    BLOCK,
    EQUATION_SUMS,
    NORMAL,
    PLACE,
    TERM_ROWS,
    TO_NEAREST,
    WEIGHT,
    add_terms,
    solve_cholesky,
    unpack_equations,
)
from mpe_core.kernels.rigid_motion import update_pose

F32, ZERO = np.float32, np.float32(0.0)
SURFACE = "Tuple((float32[:, ::1], float32[:, ::1], float32[::1]))"
"""Points (N, 3), unit normals (N, 3) and weights (N,)."""
LATTICE = "Tuple((int32[:, :, ::1], float32[::1], float32))"
"""Rows (nx, ny, nz) of the nearest target points, origin (3,) and edge of the cells."""
SCHEDULE = "Tuple((float32, float32, int64))"
"""First and last softening length eps, and the number of iterations."""
FAST = {"cache": True, "fastmath": True, "error_model": "numpy"}


COSINE = TERM_ROWS
"""Row of a block that holds the cosine between both normals."""


@njit(
    f"int64(float32[:, ::1], {SURFACE}, {SURFACE}, {LATTICE}, int64, float32[:, ::1])",
    **FAST,
)
def fill_block(pose, source, target, lattice, first, block):
    """Look up the nearest points of the BLOCK points of the source from `first` on.

    Parameters
    ----------
    pose
        (3, 4) rotation and translation.
    source, target, lattice
        As in `descend_poses`.
    first
        Row of the first point.
    block
        (COSINE + 1, BLOCK) receives the terms of the points, see `add_terms`, with the smaller
        weight of both points for weights, and the cosines.

    Returns
    -------
    The number of points.
    """
    points, normals, weights = source
    target_points, target_normals, target_weights = target
    rows, origin, cell = lattice
    nx, ny, nz = rows.shape
    inverse = F32(1.0) / cell
    r00, r01, r02, t0 = pose[0, 0], pose[0, 1], pose[0, 2], pose[0, 3]
    r10, r11, r12, t1 = pose[1, 0], pose[1, 1], pose[1, 2], pose[1, 3]
    r20, r21, r22, t2 = pose[2, 0], pose[2, 1], pose[2, 2], pose[2, 3]
    count = min(BLOCK, points.shape[0] - first)
    for k in range(count):
        i = first + k
        sx, sy, sz = points[i, 0], points[i, 1], points[i, 2]
        px = r00 * sx + r01 * sy + r02 * sz + t0
        py = r10 * sx + r11 * sy + r12 * sz + t1
        pz = r20 * sx + r21 * sy + r22 * sz + t2
        ix = min(max(int((px - origin[0]) * inverse), 0), nx - 1)
        iy = min(max(int((py - origin[1]) * inverse), 0), ny - 1)
        iz = min(max(int((pz - origin[2]) * inverse), 0), nz - 1)
        j = rows[ix, iy, iz]
        ax, ay, az = target_normals[j, 0], target_normals[j, 1], target_normals[j, 2]
        sx, sy, sz = normals[i, 0], normals[i, 1], normals[i, 2]
        block[PLACE, k], block[PLACE + 1, k], block[PLACE + 2, k] = px, py, pz
        block[TO_NEAREST, k] = target_points[j, 0] - px
        block[TO_NEAREST + 1, k] = target_points[j, 1] - py
        block[TO_NEAREST + 2, k] = target_points[j, 2] - pz
        block[NORMAL, k], block[NORMAL + 1, k], block[NORMAL + 2, k] = ax, ay, az
        block[COSINE, k] = (
            ax * (r00 * sx + r01 * sy + r02 * sz)
            + ay * (r10 * sx + r11 * sy + r12 * sz)
            + az * (r20 * sx + r21 * sy + r22 * sz)
        )
        block[WEIGHT, k] = min(weights[i], target_weights[j])
    return count


@njit("float32(float32[:, ::1], int64, float32, boolean)", **FAST)
def weigh_block(block, count, eps2, is_oriented):
    """Write the weights of the terms of a block into its row of weights.

    Parameters
    ----------
    block, count
        Points as `fill_block` leaves them, and their number.
    eps2, is_oriented
        As in `normal_equations`.

    Returns
    -------
    The sum of the points' scores.
    """
    dx, dy, dz = block[TO_NEAREST], block[TO_NEAREST + 1], block[TO_NEAREST + 2]
    weight, cosine = block[WEIGHT], block[COSINE]
    score = ZERO
    for k in range(count):
        agree = max(cosine[k], ZERO) if is_oriented else cosine[k]
        pull = eps2 / (dx[k] * dx[k] + dy[k] * dy[k] + dz[k] * dz[k] + eps2)
        w = weight[k] * agree * agree * pull
        score += w
        weight[k] = w * pull
    return score


@njit(
    f"float32(float64[:, ::1], {SURFACE}, {SURFACE}, {LATTICE}, float32, float32, boolean,"
    " float64[:, ::1], float64[::1])",
    **FAST,
)
def normal_equations(T, source, target, lattice, eps2, tangential_weight, is_oriented, H, g):
    """Write the normal equations of one step of `descend_poses` at the pose T.

    Parameters
    ----------
    T, source, target, lattice, tangential_weight, is_oriented
        As in `descend_poses`, of one pose.
    eps2
        Square of the softening length.
    H, g
        (6, 6) matrix and (6,) right side.

    Returns
    -------
    The sum of the points' scores.
    """
    pose, block = np.empty((3, 4), np.float32), np.empty((COSINE + 1, BLOCK), np.float32)
    pose[:] = T[:3]
    sums, score = np.zeros(EQUATION_SUMS), ZERO
    for first in range(0, source[0].shape[0], BLOCK):
        count = fill_block(pose, source, target, lattice, first, block)
        score += weigh_block(block, count, eps2, is_oriented)
        add_terms(block, count, tangential_weight, sums)
    unpack_equations(sums, H, g)
    return score


@njit(
    f"void(float64[:, :, ::1], float32[::1], {SURFACE}, {SURFACE}, {LATTICE}, {SCHEDULE}, float32,"
    " boolean)",
    parallel=True,
    **FAST,
)
def descend_poses(poses, scores, source, target, lattice, schedule, tangential_weight, is_oriented):
    """Majorize-minimize the P2 energy of every pose in place, then score it.

    Each iteration minimizes sum w [(n.r)^2 + tangential_weight |r|^2], r = y - p, over a small
    motion, with w = K |n.n'|^2 / (|r|^2 + eps^2)^2, where y and n are the nearest target point and
    its normal, and K is the smaller weight of both points. eps falls geometrically.

    Parameters
    ----------
    poses
        (K, 4, 4) T_target_source, replaced.
    scores
        (K,) receives the share of the source's weight that is matched at the last eps, 0 to 1.
    source, target
        Points, normals and weights, as `SURFACE`.
    lattice
        Rows of the nearest target points, as `LATTICE`.
    schedule
        First and last eps, and the iterations, as `SCHEDULE`.
    tangential_weight
        Weight of the distance along the surface beside that across it.
    is_oriented
        Whether the sign of normals counts: points whose normals are opposed then weigh nothing.
    """
    start, end, iterations = schedule
    ratio = (end / start) ** (1.0 / max(1, iterations - 1))
    total = ZERO
    for weight in source[2]:
        total += weight
    for c in prange(poses.shape[0]):
        T = poses[c].copy()
        H = np.empty((6, 6), np.float64)
        g = np.empty(6, np.float64)
        for iteration in range(iterations + 1):
            eps = end if iteration == iterations else start * ratio**iteration
            eps2 = F32(eps * eps)
            score = normal_equations(
                T, source, target, lattice, eps2, tangential_weight, is_oriented, H, g
            )
            if iteration == iterations:
                scores[c] = score / total
            else:
                # a share of the trace holds directions that nothing constrains
                H += (1e-6 * np.trace(H) + 1e-12) * np.eye(6)
                if solve_cholesky(H, g):
                    update_pose(T, g)
        poses[c] = T
