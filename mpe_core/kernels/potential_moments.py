"""Terms of the energy, gradient and curvature of the full-sum P2 potential, point by point."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

ONE = np.float32(1)


@njit(
    "UniTuple(f4, 11)(f4, f4, f4, f4, f4[::1], f4[::1], f4[::1])",
    fastmath=True,
    error_model="numpy",
    cache=True,
)
def _moments(x, y, z, eps2, px, py, pz):
    energy, w_sum = np.float32(0), np.float32(0)
    gx, gy, gz = np.float32(0), np.float32(0), np.float32(0)
    xx, xy, xz = np.float32(0), np.float32(0), np.float32(0)
    yy, yz, zz = np.float32(0), np.float32(0), np.float32(0)
    for j in range(px.shape[0]):
        dx, dy, dz = px[j] - x, py[j] - y, pz[j] - z
        u = ONE / (dx * dx + dy * dy + dz * dz + eps2)
        w = u * u
        v = w * u
        energy += u
        w_sum += w
        gx += w * dx
        gy += w * dy
        gz += w * dz
        xx += v * dx * dx
        xy += v * dx * dy
        xz += v * dx * dz
        yy += v * dy * dy
        yz += v * dy * dz
        zz += v * dz * dz
    return energy, w_sum, gx, gy, gz, xx, xy, xz, yy, yz, zz


@njit("void(f4[:, ::1], f4[:, ::1], f4, f4[:, ::1])", cache=True, parallel=True)
def potential_moments(x, y, eps, out):
    """Write the moments of the potential of y (3, M) at each point of x (3, N).

    With d = y_j - x_i and u = 1 / (|d|^2 + eps^2), row i of out (N, 11) receives the sums over j of
    u, u^2, u^2 d (3 columns) and u^3 d d^T (6 columns: xx xy xz yy yz zz).
    """
    for i in prange(x.shape[1]):
        m = _moments(x[0, i], x[1, i], x[2, i], eps * eps, y[0], y[1], y[2])
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = m[0], m[1], m[2], m[3]
        out[i, 4], out[i, 5], out[i, 6], out[i, 7] = m[4], m[5], m[6], m[7]
        out[i, 8], out[i, 9], out[i, 10] = m[8], m[9], m[10]
