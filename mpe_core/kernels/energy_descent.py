"""Descent of many poses at once on the P2 energy.

Each pose compares one small sample of the source with the target's nearest points, which it reads
from a lattice.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.motion_equations import EQUATION_SUMS, solve_cholesky, unpack_equations
from mpe_core.kernels.rigid_motion import update_pose

F32, ZERO = np.float32, np.float32(0.0)
SURFACE = "Tuple((float32[:, ::1], float32[:, ::1], float32[::1]))"
"""Points (N, 3), unit normals (N, 3) and weights (N,)."""
LATTICE = "Tuple((int32[:, :, ::1], float32[::1], float32))"
"""Rows (nx, ny, nz) of the nearest target points, origin (3,) and edge of the cells."""
SCHEDULE = "Tuple((float32, float32, int64))"
"""First and last softening length eps, and the number of iterations."""
FAST = {"cache": True, "fastmath": True, "error_model": "numpy"}


BLOCK = 64
"""Points that are looked up before their terms are added."""
BLOCK_ROWS = 11
"""Numbers of a point in a block: its place and that of the nearest point from there, the normal of
that, the cosine between both normals, and the smaller weight."""


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
        (BLOCK_ROWS, BLOCK) receives a column for each point.

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
        block[0, k], block[1, k], block[2, k] = px, py, pz
        block[3, k] = target_points[j, 0] - px
        block[4, k] = target_points[j, 1] - py
        block[5, k] = target_points[j, 2] - pz
        block[6, k], block[7, k], block[8, k] = ax, ay, az
        block[9, k] = (
            ax * (r00 * sx + r01 * sy + r02 * sz)
            + ay * (r10 * sx + r11 * sy + r12 * sz)
            + az * (r20 * sx + r21 * sy + r22 * sz)
        )
        block[10, k] = min(weights[i], target_weights[j])
    return count


@njit(
    "float32(float32[:, ::1], int64, float32, float32, boolean, float32[::1])",
    **FAST,
)
def add_block(block, count, eps2, tangential_weight, is_oriented, sums):
    """Add the terms of the points of a block to the normal equations.

    Parameters
    ----------
    block, count
        Points as `fill_block` leaves them, and their number.
    eps2, tangential_weight, is_oriented
        As in `normal_equations`.
    sums
        (27,) upper triangle of H, row by row, and g, to which the terms are added.

    Returns
    -------
    The sum of the points' scores.
    """
    # Unrolled, over columns and without a lookup, so that the compiler turns it into vector
    # instructions: three times as fast. It is the inner loop of the search.
    x, y, z, nx, ny, nz = block[0], block[1], block[2], block[6], block[7], block[8]
    to_x, to_y, to_z, cosine, weight = block[3], block[4], block[5], block[9], block[10]
    h00 = h01 = h02 = h03 = h04 = h05 = h11 = h12 = h13 = h14 = h15 = ZERO
    h22 = h23 = h24 = h25 = h33 = h34 = h35 = h44 = h45 = h55 = ZERO
    g0 = g1 = g2 = g3 = g4 = g5 = score = ZERO
    for k in range(count):
        px, py, pz, ax, ay, az = x[k], y[k], z[k], nx[k], ny[k], nz[k]
        dx, dy, dz = to_x[k], to_y[k], to_z[k]
        agree = max(cosine[k], ZERO) if is_oriented else cosine[k]
        pull = eps2 / (dx * dx + dy * dy + dz * dz + eps2)
        w = weight[k] * agree * agree * pull
        score += w
        w *= pull
        d = dx * ax + dy * ay + dz * az
        cx, cy, cz = py * az - pz * ay, pz * ax - px * az, px * ay - py * ax
        wcx, wcy, wcz, wax, way, waz = w * cx, w * cy, w * cz, w * ax, w * ay, w * az
        s = w * tangential_weight
        spx, spy, spz = s * px, s * py, s * pz
        h00 += wcx * cx + spy * py + spz * pz
        h01 += wcx * cy - spx * py
        h02 += wcx * cz - spx * pz
        h03 += wcx * ax
        h04 += wcx * ay - spz
        h05 += wcx * az + spy
        h11 += wcy * cy + spx * px + spz * pz
        h12 += wcy * cz - spy * pz
        h13 += wcy * ax + spz
        h14 += wcy * ay
        h15 += wcy * az - spx
        h22 += wcz * cz + spx * px + spy * py
        h23 += wcz * ax - spy
        h24 += wcz * ay + spx
        h25 += wcz * az
        h33 += wax * ax + s
        h34 += wax * ay
        h35 += wax * az
        h44 += way * ay + s
        h45 += way * az
        h55 += waz * az + s
        g0 += wcx * d + s * (py * dz - pz * dy)
        g1 += wcy * d + s * (pz * dx - px * dz)
        g2 += wcz * d + s * (px * dy - py * dx)
        g3 += wax * d + s * dx
        g4 += way * d + s * dy
        g5 += waz * d + s * dz
    terms = (
        *(h00, h01, h02, h03, h04, h05, h11, h12, h13, h14, h15, h22, h23, h24, h25),
        *(h33, h34, h35, h44, h45, h55, g0, g1, g2, g3, g4, g5),
    )
    for m in range(EQUATION_SUMS):
        sums[m] += terms[m]
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
    pose, block = np.empty((3, 4), np.float32), np.empty((BLOCK_ROWS, BLOCK), np.float32)
    pose[:] = T[:3]
    sums, score = np.zeros(EQUATION_SUMS, np.float32), ZERO
    for first in range(0, source[0].shape[0], BLOCK):
        count = fill_block(pose, source, target, lattice, first, block)
        score += add_block(block, count, eps2, tangential_weight, is_oriented, sums)
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
