"""Normal equations of a small motion, its six unknowns rotation before translation."""

from __future__ import annotations

import numpy as np
from numba import njit

EQUATION_SUMS = 27
"""Numbers of a sum of normal equations H x = g: the upper triangle of H, row by row, and g."""


@njit(
    [
        "void(float32[::1], float64[:, ::1], float64[::1])",
        "void(float64[::1], float64[:, ::1], float64[::1])",
    ],
    cache=True,
)
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
