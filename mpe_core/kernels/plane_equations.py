"""Normal equations of the point-to-plane residual."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

ROWS_PER_TASK = 512
"""Points that one task sums; fixed, so the total does not depend on the threads."""


VECTOR = "UniTuple(float32, 3)"


@njit(
    f"boolean({VECTOR}, {VECTOR}, {VECTOR}, float32, float64[::1], float64[:, ::1], float64[::1])",
    cache=True,
    error_model="numpy",
    inline="always",
)
def add_row(point, nearest, normal, cutoff, J, H, g):
    """Add the equation of one point to H (6, 6) and g (6,); `J` (6,) is scratch.

    Returns
    -------
    Whether it has a weight.
    """
    px, py, pz = point
    nx, ny, nz = normal
    d = (nearest[0] - px) * nx + (nearest[1] - py) * ny + (nearest[2] - pz) * nz
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
    return u < 1.0


@njit(
    "Tuple((float64[:, :, ::1], float64[:, ::1]))"
    "(float32[:, ::1], float32[:, ::1], float32[:, ::1], boolean[::1], float32)",
    cache=True,
    parallel=True,
    error_model="numpy",
)
def plane_equations(points, nearest, normals, valid, cutoff):
    """Return the normal equations of the robust point-to-plane sum, per task.

    The sum is that of rho(n.(y - p)) over a small motion p -> p + w x p + v, with Tukey's biweight
    rho. Its step (w, v) solves H (w, v) = g.

    Parameters
    ----------
    points, nearest, normals
        (N, 3) points p, their correspondences y and the unit normals n there.
    valid
        (N,) whether the row counts.
    cutoff
        Distance from the plane from which on a point has no weight.

    Returns
    -------
    H (tasks, 6, 6) and g (tasks, 6), to be summed over the tasks.
    """
    n = points.shape[0]
    tasks = (n + ROWS_PER_TASK - 1) // ROWS_PER_TASK
    H = np.zeros((tasks, 6, 6))
    g = np.zeros((tasks, 6))
    for task in prange(tasks):
        J = np.empty(6)
        for i in range(task * ROWS_PER_TASK, min(n, (task + 1) * ROWS_PER_TASK)):
            if not valid[i]:
                continue
            add_row(
                (points[i, 0], points[i, 1], points[i, 2]),
                (nearest[i, 0], nearest[i, 1], nearest[i, 2]),
                (normals[i, 0], normals[i, 1], normals[i, 2]),
                cutoff,
                J,
                H[task],
                g[task],
            )
    return H, g
