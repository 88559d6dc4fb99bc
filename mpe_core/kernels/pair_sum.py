"""Exact forces between all pairs of points of two clouds (3, count) float32.

One thread sums a row, in blocks of fixed length: float32 within a block, float64 across blocks.
The bits therefore do not depend on the number of threads, and the rounding error does not grow
with the number of points.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

# error_model: Python's check for division by zero is a branch, which keeps LLVM from vectorizing.
# For the same reason the loop over a block is a function of its own and not in prange; each is
# worth a factor of eight (docs/tuning.md).
FAST = {"fastmath": True, "error_model": "numpy", "cache": True}
BLOCK = 1024
"""Points summed in float32 before the sum goes to float64."""
ONE = np.float32(1)
TINY = np.float32(1e-20)
"""Keeps n_ij of coincident points finite: their force is zero."""


@njit("UniTuple(f4, 3)(f4, f4, f4, f4, f4[::1], f4[::1], f4[::1], f4[::1])", **FAST)
def block_force(
    x: float,
    y: float,
    z: float,
    eps2: float,
    px: NDArray[np.float32],
    py: NDArray[np.float32],
    pz: NDArray[np.float32],
    weights: NDArray[np.float32],
) -> tuple[np.float32, np.float32, np.float32]:
    """Return the force of points on the point (x, y, z); `weights` is empty where all are 1."""
    fx, fy, fz = np.float32(0), np.float32(0), np.float32(0)
    is_weighted = weights.shape[0] > 0  # the compiler makes two loops of this one
    for j in range(px.shape[0]):
        dx, dy, dz = px[j] - x, py[j] - y, pz[j] - z
        r2 = dx * dx + dy * dy + dz * dz + TINY
        pull = (weights[j] if is_weighted else ONE) / ((r2 + eps2) * np.sqrt(r2))
        fx += pull * dx
        fy += pull * dy
        fz += pull * dz
    return fx, fy, fz


@njit("void(f4[:,::1], f4[:,::1], f4[::1], f4, f8[:,::1])", parallel=True, **FAST)
def pair_force(
    x: NDArray[np.float32],
    y: NDArray[np.float32],
    weights: NDArray[np.float32],
    eps: float,
    force: NDArray[np.float64],
) -> None:
    """Write the forces of y (3, M) on x (3, N) into force (3, N): Eq. 7 with K_i = 1.

    force[:, i] = -sum_j w_j n_ij / (|x_i - y_j|^2 + eps^2), with the weights w (M,), an empty array
    where all are 1.
    """
    count = y.shape[1]
    for i in prange(x.shape[1]):
        fx, fy, fz = 0.0, 0.0, 0.0
        for start in range(0, count, BLOCK):
            end = min(start + BLOCK, count)
            bx, by, bz = block_force(
                x[0, i],
                x[1, i],
                x[2, i],
                eps * eps,
                y[0, start:end],
                y[1, start:end],
                y[2, start:end],
                weights[start:end],
            )
            fx += bx
            fy += by
            fz += bz
        force[0, i], force[1, i], force[2, i] = fx, fy, fz
