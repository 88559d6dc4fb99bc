"""Exact double sums over all pairs of points; clouds are (3, count) float32.

Every row is summed by one thread, in blocks of fixed length: float32 within a block, float64
across blocks. So the bits do not depend on the number of threads, and the rounding error does not
grow with the number of points.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

# error_model: Python's check for division by zero is a branch, which makes the loops ten times
# slower (1.2 instead of 11 billion pairs/s). The block functions are apart because LLVM does not
# vectorise their loops inside prange (1.4).
FAST = {"fastmath": True, "error_model": "numpy", "cache": True}
BLOCK = 1024
ONE = np.float32(1)
TINY = np.float32(1e-20)  # keeps n_ij of coincident points finite: their force is zero


@njit("UniTuple(f4, 3)(f4, f4, f4, f4, f4[::1], f4[::1], f4[::1], f4[::1])", **FAST)
def block_force(
    x: float,
    y: float,
    z: float,
    eps2: float,
    px: NDArray[np.float32],
    py: NDArray[np.float32],
    pz: NDArray[np.float32],
    mass: NDArray[np.float32],
) -> tuple[np.float32, np.float32, np.float32]:
    """Pull of points on one point; `mass` is empty where all have 1."""
    fx, fy, fz = np.float32(0), np.float32(0), np.float32(0)
    weighed = mass.shape[0] > 0  # the compiler makes two loops; a mass costs a tenth more time
    for j in range(px.shape[0]):
        dx, dy, dz = px[j] - x, py[j] - y, pz[j] - z
        r2 = dx * dx + dy * dy + dz * dz + TINY
        pull = (mass[j] if weighed else ONE) / ((r2 + eps2) * np.sqrt(r2))
        fx += pull * dx
        fy += pull * dy
        fz += pull * dz
    return fx, fy, fz


@njit("void(f4[:,::1], f4[:,::1], f4[::1], f4, f8[:,::1])", parallel=True, **FAST)
def pair_force(
    x: NDArray[np.float32],
    y: NDArray[np.float32],
    mass: NDArray[np.float32],
    eps: float,
    force: NDArray[np.float64],
) -> None:
    """force[:, i] = -sum_j m_j n_ij / (|x_i - y_j|^2 + eps^2): Eq. 7 with K_i = 1. `mass` (M,) is
    empty where all m_j are 1."""
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
                mass[start:end],
            )
            fx += bx
            fy += by
            fz += bz
        force[0, i], force[1, i], force[2, i] = fx, fy, fz
