"""Normal equations of a small motion, its six unknowns rotation before translation."""

from __future__ import annotations

import numpy as np
from numba import njit

EQUATION_SUMS = 27
"""Numbers of a sum of normal equations H x = g: the upper triangle of H, row by row, and g."""


BLOCK = 64
"""Points that are looked up before their terms are added (docs/tuning.md)."""

PLACE, TO_NEAREST, NORMAL, WEIGHT, TERM_ROWS = 0, 3, 6, 9, 10
"""First rows of a block of terms, a column for each point: its place, the way to the point that it
is laid on, the normal there, and the weight of the term; number of rows."""


@njit(
    "void(float32[:, ::1], int64, float32, float64[::1])",
    cache=True,
    fastmath=True,
    error_model="numpy",
)
def add_terms(block, count, tangential_weight, sums):
    """Add the terms of some points to the normal equations.

    That of a point is w [(n.r)^2 + tangential_weight |r|^2], r the way to the point that it is laid
    on, over a small motion p -> p + w x p + v.

    Parameters
    ----------
    block
        (TERM_ROWS or more, BLOCK) terms.
    count
        Number of points.
    tangential_weight
        Weight of the distance along the surface beside that across it.
    sums
        (27,) sums that the terms are added to.
    """
    # Unrolled, over columns and without a lookup, so that the compiler turns it into vector
    # instructions: three times as fast. It is the inner loop of search and refinement.
    x, y, z = block[PLACE], block[PLACE + 1], block[PLACE + 2]
    to_x, to_y, to_z = block[TO_NEAREST], block[TO_NEAREST + 1], block[TO_NEAREST + 2]
    nx, ny, nz, weight = block[NORMAL], block[NORMAL + 1], block[NORMAL + 2], block[WEIGHT]
    zero = np.float32(0.0)
    h00 = h01 = h02 = h03 = h04 = h05 = h11 = h12 = h13 = h14 = h15 = zero
    h22 = h23 = h24 = h25 = h33 = h34 = h35 = h44 = h45 = h55 = zero
    g0 = g1 = g2 = g3 = g4 = g5 = zero
    for k in range(count):
        px, py, pz, ax, ay, az = x[k], y[k], z[k], nx[k], ny[k], nz[k]
        dx, dy, dz, w = to_x[k], to_y[k], to_z[k], weight[k]
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
    for k in range(EQUATION_SUMS):
        sums[k] += terms[k]


@njit("void(float64[::1], float64[:, ::1], float64[::1])", cache=True)
def unpack_equations(sums, H, g):
    """Write the (27,) sums into H (6, 6) and g (6,)."""
    k = 0
    for r in range(6):
        g[r] = sums[EQUATION_SUMS - 6 + r]
        for c in range(r, 6):
            H[r, c] = H[c, r] = sums[k]
            k += 1


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
