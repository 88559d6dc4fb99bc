"""Planes through the neighbourhoods of points, from cell lists (kernels/cells.py)."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.cell_list import STEPS, cell_around, gap, run


@njit(
    "UniTuple(float64, 6)(float64, float64, float64, float64, float64, float64)",
    cache=True,
    error_model="numpy",
)
def smallest_axis(xx, xy, xz, yy, yz, zz):
    """Unit eigenvector of the smallest eigenvalue, and the eigenvalues ascending, of a symmetric
    3x3 matrix."""
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    p = np.sqrt((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if p <= 1e-16:
        return 0.0, 0.0, 1.0, mean, mean, mean
    a, b, c, d, e, f = a / p, b / p, c / p, xy / p, xz / p, yz / p
    half_det = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))
    phi = np.arccos(min(1.0, max(-1.0, half_det))) / 3.0
    high = mean + 2.0 * p * np.cos(phi)
    low = mean + 2.0 * p * np.cos(phi + 2.0943951023931953)
    # rows of (M - low I) span the plane of the other two axes: the longest cross product is
    # the axis
    ax, ay, az, most = 0.0, 0.0, 1.0, -1.0
    rows = ((xx - low, xy, xz), (xy, yy - low, yz), (xz, yz, zz - low))
    for k in range(3):
        (ux, uy, uz), (vx, vy, vz) = rows[k], rows[(k + 1) % 3]
        cx, cy, cz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = cx * cx + cy * cy + cz * cz
        if length > most:
            ax, ay, az, most = cx, cy, cz, length
    scale = 1.0 / np.sqrt(max(most, 1e-300))
    return ax * scale, ay * scale, az * scale, low, 3.0 * mean - high - low, high


@njit(
    "UniTuple(float32, 10)(float32, float32, float32, float32, float32[::1], float32[::1],"
    " float32[::1])",
    cache=True,
    fastmath=True,
)
def moments(qx, qy, qz, limit, px, py, pz):
    """Count, sums and sums of products (xx, xy, xz, yy, yz, zz) of the offsets within the squared
    distance `limit`."""
    k = sx = sy = sz = np.float32(0.0)
    xx = xy = xz = yy = yz = zz = np.float32(0.0)
    # apart from prange and without a branch, so that the compiler turns it into vectors
    for j in range(px.shape[0]):
        dx, dy, dz = px[j] - qx, py[j] - qy, pz[j] - qz
        w = np.float32(1.0) if dx * dx + dy * dy + dz * dz <= limit else np.float32(0.0)
        wx, wy, wz = w * dx, w * dy, w * dz
        k += w
        sx += wx
        sy += wy
        sz += wz
        xx += wx * dx
        xy += wx * dy
        xz += wx * dz
        yy += wy * dy
        yz += wy * dz
        zz += wz * dz
    return k, sx, sy, sz, xx, xy, xz, yy, yz, zz


@njit(
    "Tuple((float32[:, ::1], float32[::1], float32[::1], int32[::1], float32[::1]))"
    "(float32[:, ::1], float32, float32[:, ::1], int32[::1], int64[::1], int32[::1], float32[::1],"
    " float32)",
    cache=True,
    parallel=True,
)
def local_planes(queries, radius, columns, starts, keys, slots, origin, size):
    """Plane through the points within `radius` (at most the cell size) of each query: (unit
    normals, surface variation = smallest eigenvalue / sum, standard deviation from the plane,
    number of points, distance of the plane from the query along the normal)."""
    n = queries.shape[0]
    normals = np.zeros((n, 3), np.float32)
    variation = np.ones(n, np.float32)
    thickness = np.full(n, radius)
    counts = np.zeros(n, np.int32)
    offsets = np.zeros(n, np.float32)
    limit = radius * radius
    x, y, z = columns[0], columns[1], columns[2]
    for i in prange(n):
        qx, qy, qz = queries[i, 0], queries[i, 1], queries[i, 2]
        fx, fy, fz, ux, uy, uz = cell_around(qx, qy, qz, origin, size)
        k = sx = sy = sz = np.float32(0.0)
        xx = xy = xz = yy = yz = zz = np.float32(0.0)
        for tx in STEPS:
            gx = gap(tx, ux, size)
            for ty in STEPS:
                gy = gx + gap(ty, uy, size)
                ix, iy = np.int64(fx) + tx, np.int64(fy) + ty
                if gy > limit or min(ix, iy) < 0:
                    continue
                a, b = run(ix, iy, np.int64(fz), uz, size, limit - gy, keys, slots, starts)
                m = moments(qx, qy, qz, limit, x[a:b], y[a:b], z[a:b])
                k, sx, sy, sz = k + m[0], sx + m[1], sy + m[2], sz + m[3]
                xx, xy, xz = xx + m[4], xy + m[5], xz + m[6]
                yy, yz, zz = yy + m[7], yz + m[8], zz + m[9]
        counts[i] = np.int32(k)
        if counts[i] >= 5:
            share = 1.0 / k
            mx, my, mz = sx * share, sy * share, sz * share
            ax, ay, az, low, middle, high = smallest_axis(
                xx * share - mx * mx,
                xy * share - mx * my,
                xz * share - mx * mz,
                yy * share - my * my,
                yz * share - my * mz,
                zz * share - mz * mz,
            )
            low = max(low, 0.0)
            normals[i, 0], normals[i, 1], normals[i, 2] = ax, ay, az
            variation[i] = low / max(low + middle + high, 1e-30)
            thickness[i] = np.sqrt(low)
            offsets[i] = mx * ax + my * ay + mz * az
    return normals, variation, thickness, counts, offsets
