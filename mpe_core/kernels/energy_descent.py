"""Descent of many poses at once on the P2 energy.

Each pose compares one small sample of the source with the target's nearest points, which it reads
from a lattice.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.rigid_motion import update_pose


@njit("boolean(float64[:, ::1], float64[::1])", cache=True, error_model="numpy")
def solve_cholesky(a, b):
    """Solve the positive definite system a x = b of six unknowns in place.

    Parameters
    ----------
    a
        (6, 6) matrix of which the lower triangle is read; overwritten by its Cholesky factor.
    b
        (6,) right side; overwritten by x.

    Returns
    -------
    False if the matrix is not positive definite; b is then useless.
    """
    for i in range(6):
        for j in range(i + 1):
            s = a[i, j]
            for k in range(j):
                s -= a[i, k] * a[j, k]
            if i == j:
                if not s > 0.0:
                    return False
                a[i, i] = np.sqrt(s)
            else:
                a[i, j] = s / a[j, j]
    for i in range(6):
        s = b[i]
        for k in range(i):
            s -= a[i, k] * b[k]
        b[i] = s / a[i, i]
    for i in range(5, -1, -1):
        s = b[i]
        for k in range(i + 1, 6):
            s -= a[k, i] * b[k]
        b[i] = s / a[i, i]
    return True


F32, ZERO = np.float32, np.float32(0.0)
SURFACE = "Tuple((float32[:, ::1], float32[:, ::1], float32[::1]))"
"""Points (N, 3), unit normals (N, 3) and weights (N,)."""
LATTICE = "Tuple((int32[:, :, ::1], float32[::1], float32))"
"""Rows (nx, ny, nz) of the nearest target points, origin (3,) and edge of the cells."""
SCHEDULE = "Tuple((float32, float32, int64))"
"""First and last softening length eps, and the number of iterations."""
FAST = {"cache": True, "fastmath": True, "error_model": "numpy"}


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
        (6, 6) matrix, of which the lower half is written, and (6,) right side.

    Returns
    -------
    The sum of the points' scores.
    """
    # Unrolled on purpose: 27 sums in registers, where a loop over J J^T writes H to memory for each
    # point. It is the inner loop of the search.
    points, normals, weights = source
    target_points, target_normals, target_weights = target
    rows, origin, cell = lattice
    nx, ny, nz = rows.shape
    inverse = F32(1.0) / cell
    r00, r01, r02, t0 = F32(T[0, 0]), F32(T[0, 1]), F32(T[0, 2]), F32(T[0, 3])
    r10, r11, r12, t1 = F32(T[1, 0]), F32(T[1, 1]), F32(T[1, 2]), F32(T[1, 3])
    r20, r21, r22, t2 = F32(T[2, 0]), F32(T[2, 1]), F32(T[2, 2]), F32(T[2, 3])
    h00 = h01 = h02 = h03 = h04 = h05 = h11 = h12 = h13 = h14 = h15 = ZERO
    h22 = h23 = h24 = h25 = h33 = h34 = h35 = h44 = h45 = h55 = ZERO
    g0 = g1 = g2 = g3 = g4 = g5 = score = ZERO
    for i in range(points.shape[0]):
        sx, sy, sz = points[i, 0], points[i, 1], points[i, 2]
        px = r00 * sx + r01 * sy + r02 * sz + t0
        py = r10 * sx + r11 * sy + r12 * sz + t1
        pz = r20 * sx + r21 * sy + r22 * sz + t2
        ix = min(max(int((px - origin[0]) * inverse), 0), nx - 1)
        iy = min(max(int((py - origin[1]) * inverse), 0), ny - 1)
        iz = min(max(int((pz - origin[2]) * inverse), 0), nz - 1)
        j = rows[ix, iy, iz]
        dx, dy, dz = target_points[j, 0] - px, target_points[j, 1] - py, target_points[j, 2] - pz
        ax, ay, az = target_normals[j, 0], target_normals[j, 1], target_normals[j, 2]
        sx, sy, sz = normals[i, 0], normals[i, 1], normals[i, 2]
        agree = (
            ax * (r00 * sx + r01 * sy + r02 * sz)
            + ay * (r10 * sx + r11 * sy + r12 * sz)
            + az * (r20 * sx + r21 * sy + r22 * sz)
        )
        if is_oriented:
            agree = max(agree, ZERO)
        pull = eps2 / (dx * dx + dy * dy + dz * dz + eps2)
        w = min(weights[i], target_weights[j]) * agree * agree * pull
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
    H[0, 0], H[1, 0], H[1, 1] = h00, h01, h11
    H[2, 0], H[2, 1], H[2, 2] = h02, h12, h22
    H[3, 0], H[3, 1], H[3, 2], H[3, 3] = h03, h13, h23, h33
    H[4, 0], H[4, 1], H[4, 2], H[4, 3], H[4, 4] = h04, h14, h24, h34, h44
    H[5, 0], H[5, 1], H[5, 2], H[5, 3], H[5, 4], H[5, 5] = h05, h15, h25, h35, h45, h55
    g[0], g[1], g[2], g[3], g[4], g[5] = g0, g1, g2, g3, g4, g5
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
