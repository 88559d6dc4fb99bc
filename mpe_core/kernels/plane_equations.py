"""Normal equations of the robust point-to-plane sum, and their solution."""

from __future__ import annotations

import numpy as np
from numba import njit

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

MOVING = "Tuple((float32[:, ::1], float32[:, ::1]))"
"""Points (N, 3), and unit normals (N, 3) that point outwards, or (0, 3) if these are unknown."""
PLANES = "Tuple((float32[:, ::1], float32[:, ::1]))"
"""A point (M, 3) of each plane in the order of the cells, and unit normals (M, 3)."""


@njit("void(float64[:, ::1], float32[::1], float32[::1])", cache=True)
def move_point(T, point, moved):
    """Write the place of a point (3,) at the pose T into moved (3,)."""
    for a in range(3):
        moved[a] = T[a, 0] * point[0] + T[a, 1] * point[1] + T[a, 2] * point[2] + T[a, 3]


@njit(
    f"int64(float64[:, ::1], int32[::1], {MOVING}, {PLANES}, int64, int64, float32[:, ::1])",
    cache=True,
)
def fill_block(T, nearest, moving, planes, first, last, block):
    """Look up the planes of the points first:last that have one and face it.

    Parameters
    ----------
    T, nearest, moving, planes
        As those of `step_on_planes`, of one pose.
    first, last
        Bounds of the points, at most BLOCK.
    block
        (TERM_ROWS, BLOCK) takes the terms of each such point but their weights, see `add_terms`.

    Returns
    -------
    The number of columns.
    """
    points, outward = moving
    feet, normals = planes
    has_outward = outward.shape[0] > 0
    moved = np.empty(3, np.float32)
    count = 0
    for i in range(first, last):
        k = nearest[i]
        if k < 0:
            continue
        x, y, z = normals[k, 0], normals[k, 1], normals[k, 2]
        if has_outward:
            ox, oy, oz = outward[i, 0], outward[i, 1], outward[i, 2]
            facing = x * (T[0, 0] * ox + T[0, 1] * oy + T[0, 2] * oz)
            facing += y * (T[1, 0] * ox + T[1, 1] * oy + T[1, 2] * oz)
            facing += z * (T[2, 0] * ox + T[2, 1] * oy + T[2, 2] * oz)
            if facing < 0.0:
                continue
        move_point(T, points[i], moved)
        px, py, pz = moved[0], moved[1], moved[2]
        block[PLACE, count], block[PLACE + 1, count], block[PLACE + 2, count] = px, py, pz
        block[TO_NEAREST, count] = feet[k, 0] - px
        block[TO_NEAREST + 1, count] = feet[k, 1] - py
        block[TO_NEAREST + 2, count] = feet[k, 2] - pz
        block[NORMAL, count], block[NORMAL + 1, count], block[NORMAL + 2, count] = x, y, z
        count += 1
    return count


@njit("void(float32[:, ::1], int64, float32)", cache=True, fastmath=True, error_model="numpy")
def weigh_block(block, count, cutoff):
    """Write the weights of Tukey's biweight into the row of weights of a block.

    Parameters
    ----------
    block, count
        Points as `fill_block` leaves them, and their number.
    cutoff
        Cut-off of the biweight.
    """
    dx, dy, dz = block[TO_NEAREST], block[TO_NEAREST + 1], block[TO_NEAREST + 2]
    x, y, z, weight = block[NORMAL], block[NORMAL + 1], block[NORMAL + 2], block[WEIGHT]
    for k in range(count):
        u = (dx[k] * x[k] + dy[k] * y[k] + dz[k] * z[k]) / cutoff
        rest = max(np.float32(1.0) - u * u, np.float32(0.0))
        weight[k] = rest * rest


@njit(
    f"void(float64[:, ::1], int32[::1], {MOVING}, {PLANES}, float32, int64, int64, float64[::1])",
    cache=True,
)
def sum_equations(T, nearest, moving, planes, cutoff, first, last, sums):
    """Sum the normal equations of some of the points at the pose T.

    The function is the sum of rho(n.(y - p)) over a small motion p -> p + w x p + v of the moved
    points p, y the point of the plane `nearest` (N,) to each and n its normal, with Tukey's
    biweight rho. Its step (w, v) solves H (w, v) = g.

    Parameters
    ----------
    T, nearest, moving, planes, cutoff
        As those of `step_on_planes`, of one pose.
    first, last
        Bounds of the points that are summed.
    sums
        (27,) takes the upper triangle of H, row by row, and g.
    """
    block = np.empty((TERM_ROWS, BLOCK), np.float32)
    sums[:] = 0.0
    for start in range(first, last, BLOCK):
        end = min(start + BLOCK, last)
        count = fill_block(T, nearest, moving, planes, start, end, block)
        weigh_block(block, count, cutoff)
        add_terms(block, count, np.float32(0.0), sums)


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


@njit("Tuple((float64[:, ::1], float64[::1]))(float64[:, ::1])", cache=True)
def add_equations(parts):
    """Add the sums (P, 27) of parts of the points, as those of `sum_equations`.

    Returns
    -------
    H (6, 6) and g (6,).
    """
    total = np.zeros(EQUATION_SUMS)
    for part in range(parts.shape[0]):
        for k in range(EQUATION_SUMS):
            total[k] += parts[part, k]
    H, g = np.empty((6, 6)), np.empty(6)
    unpack_equations(total, H, g)
    return H, g
