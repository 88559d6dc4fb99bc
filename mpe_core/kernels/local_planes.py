"""Planes through the neighbourhoods of points, from cell lists (kernels/cells.py)."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.cells import STEPS, cell_key, find_slot, gap


@njit("Tuple((float32[::1], float32[::1]))(float64[::1])", cache=True, error_model="numpy")
def smallest_axis(m):
    """Unit eigenvector of the smallest eigenvalue, and the eigenvalues ascending, of a symmetric
    3x3 matrix given as (xx, xy, xz, yy, yz, zz)."""
    axis = np.zeros(3, np.float32)
    values = np.zeros(3, np.float32)
    xx, xy, xz, yy, yz, zz = m[0], m[1], m[2], m[3], m[4], m[5]
    mean = (xx + yy + zz) / 3.0
    p1 = xy * xy + xz * xz + yz * yz
    p2 = (xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2.0 * p1
    if p2 <= 1e-30:
        axis[2] = 1.0
        values[:] = mean
        return axis, values
    p = np.sqrt(p2 / 6.0)
    a, b, c = (xx - mean) / p, (yy - mean) / p, (zz - mean) / p
    d, e, f = xy / p, xz / p, yz / p
    half_det = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))
    phi = np.arccos(min(1.0, max(-1.0, half_det))) / 3.0
    high = mean + 2.0 * p * np.cos(phi)
    low = mean + 2.0 * p * np.cos(phi + 2.0943951023931953)
    values[0] = low
    values[1] = 3.0 * mean - high - low
    values[2] = high
    # rows of (M - low I) span the plane of the other two axes: the longest cross product is
    # the axis
    r0x, r0y, r0z = xx - low, xy, xz
    r1x, r1y, r1z = xy, yy - low, yz
    r2x, r2y, r2z = xz, yz, zz - low
    best = -1.0
    for k in range(3):
        if k == 0:
            ux, uy, uz, vx, vy, vz = r0x, r0y, r0z, r1x, r1y, r1z
        elif k == 1:
            ux, uy, uz, vx, vy, vz = r0x, r0y, r0z, r2x, r2y, r2z
        else:
            ux, uy, uz, vx, vy, vz = r1x, r1y, r1z, r2x, r2y, r2z
        cx = uy * vz - uz * vy
        cy = uz * vx - ux * vz
        cz = ux * vy - uy * vx
        length = cx * cx + cy * cy + cz * cz
        if length > best:
            best = length
            scale = 1.0 / np.sqrt(max(length, 1e-300))
            axis[0] = cx * scale
            axis[1] = cy * scale
            axis[2] = cz * scale
    return axis, values


@njit(
    "Tuple((float32[:, ::1], float32[::1], float32[::1], int32[::1], float32[::1]))"
    "(float32[:, ::1], float32[:, ::1], int32[::1], int64[::1], int32[::1], float32[::1], float32)",
    cache=True,
    parallel=True,
)
def local_planes(queries, points, starts, keys, slots, origin, radius):
    """Plane through the points within `radius` (the cell size) of each query: (unit normals,
    surface variation = smallest eigenvalue / sum, standard deviation from the plane, number of
    points, distance of the plane from the query along the normal)."""
    n = queries.shape[0]
    normals = np.zeros((n, 3), np.float32)
    variation = np.ones(n, np.float32)
    thickness = np.full(n, radius)
    counts = np.zeros(n, np.int32)
    offsets = np.zeros(n, np.float32)
    mask = keys.shape[0] - 1
    limit = radius * radius
    for i in prange(n):
        qx, qy, qz = queries[i, 0], queries[i, 1], queries[i, 2]
        fx = np.floor((qx - origin[0]) / radius)
        fy = np.floor((qy - origin[1]) / radius)
        fz = np.floor((qz - origin[2]) / radius)
        ux = qx - origin[0] - fx * radius
        uy = qy - origin[1] - fy * radius
        uz = qz - origin[2] - fz * radius
        m = np.zeros(6, np.float64)
        sx = sy = sz = np.float32(0.0)
        xx = xy = xz = yy = yz = zz = np.float32(0.0)
        k = 0
        for tx in STEPS:
            gx = gap(tx, ux, radius)
            for ty in STEPS:
                gy = gx + gap(ty, uy, radius)
                for tz in STEPS:
                    ix, iy, iz = np.int64(fx) + tx, np.int64(fy) + ty, np.int64(fz) + tz
                    if gy + gap(tz, uz, radius) > limit or min(ix, iy, iz) < 0:
                        continue
                    slot = find_slot(keys, cell_key(ix, iy, iz), mask)
                    if keys[slot] == -1:
                        continue
                    cell = slots[slot]
                    for j in range(starts[cell], starts[cell + 1]):
                        dx = points[j, 0] - qx
                        dy = points[j, 1] - qy
                        dz = points[j, 2] - qz
                        if dx * dx + dy * dy + dz * dz <= limit:
                            k += 1
                            sx += dx
                            sy += dy
                            sz += dz
                            xx += dx * dx
                            xy += dx * dy
                            xz += dx * dz
                            yy += dy * dy
                            yz += dy * dz
                            zz += dz * dz
        counts[i] = k
        if k >= 5:
            inverse = 1.0 / k
            m[0] = xx * inverse - sx * inverse * sx * inverse
            m[1] = xy * inverse - sx * inverse * sy * inverse
            m[2] = xz * inverse - sx * inverse * sz * inverse
            m[3] = yy * inverse - sy * inverse * sy * inverse
            m[4] = yz * inverse - sy * inverse * sz * inverse
            m[5] = zz * inverse - sz * inverse * sz * inverse
            axis, values = smallest_axis(m)
            normals[i] = axis
            low = max(values[0], np.float32(0.0))
            variation[i] = low / max(low + values[1] + values[2], np.float32(1e-30))
            thickness[i] = np.sqrt(low)
            offsets[i] = (sx * axis[0] + sy * axis[1] + sz * axis[2]) * inverse
    return normals, variation, thickness, counts, offsets
