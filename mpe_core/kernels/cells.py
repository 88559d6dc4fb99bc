"""Cell lists: points hashed into cubes, for thinning, neighbourhoods and nearest points.

A grid is four arrays: `keys` (table,) int64 cell key or -1, `slots` (table,) int32 cell number,
`starts` (cells + 1,) int32, and the points reordered so that cell c holds rows
starts[c]:starts[c+1].
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

F32 = np.float32
# 21 bits an axis: a cell coordinate lies in [0, 2^21)
AXIS_BITS = 21


@njit("int64(int64, int64, int64)", cache=True, inline="always")
def cell_key(ix, iy, iz):
    return (ix << 42) | (iy << 21) | iz


@njit("int64(int64, int64)", cache=True, inline="always")
def hash_slot(key, mask):
    h = key * np.int64(-7046029254386353131)
    h ^= h >> 32
    h *= np.int64(-4417276706812531889)
    return (h ^ (h >> 29)) & mask


@njit("int64(int64[::1], int64, int64)", cache=True, inline="always")
def find_slot(keys, key, mask):
    """Slot that holds the key, or the free slot where it belongs."""
    slot = hash_slot(key, mask)
    while keys[slot] != -1 and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@njit(
    "Tuple((int64[::1], int32[::1], int32[::1], int32[::1]))"
    "(float32[:, ::1], float32[::1], float32)",
    cache=True,
)
def number_cells(points, origin, size):
    """Number the occupied cells in order of first appearance: (keys, slots, cell of point,
    counts)."""
    n = points.shape[0]
    table = 16
    while table < 2 * n:
        table *= 2
    keys = np.full(table, np.int64(-1))
    slots = np.empty(table, np.int32)
    cell_of = np.empty(n, np.int32)
    counts = np.zeros(n, np.int32)
    inverse = np.float32(1.0) / size
    cells = 0
    for i in range(n):
        key = cell_key(
            np.int64((points[i, 0] - origin[0]) * inverse),
            np.int64((points[i, 1] - origin[1]) * inverse),
            np.int64((points[i, 2] - origin[2]) * inverse),
        )
        slot = find_slot(keys, key, table - 1)
        if keys[slot] == -1:
            keys[slot] = key
            slots[slot] = cells
            cells += 1
        cell_of[i] = slots[slot]
        counts[slots[slot]] += 1
    return keys, slots, cell_of, counts[:cells]


@njit(
    "Tuple((float32[:, ::1], int32[::1], int32[::1]))(float32[:, ::1], int32[::1], int32[::1])",
    cache=True,
)
def sort_by_cell(points, cell_of, counts):
    """Points in cell order: (sorted points, starts, original row of each sorted point)."""
    starts = np.zeros(counts.shape[0] + 1, np.int32)
    for c in range(counts.shape[0]):
        starts[c + 1] = starts[c] + counts[c]
    place = starts[:-1].copy()
    ordered = np.empty_like(points)
    rows = np.empty(points.shape[0], np.int32)
    for i in range(points.shape[0]):
        k = place[cell_of[i]]
        place[cell_of[i]] = k + 1
        ordered[k, 0] = points[i, 0]
        ordered[k, 1] = points[i, 1]
        ordered[k, 2] = points[i, 2]
        rows[k] = i
    return ordered, starts, rows


@njit("Tuple((float32[:, ::1], int32[::1]))(float32[:, ::1], float32[::1], float32)", cache=True)
def cell_means(points, origin, size):
    """Mean and count of the points of each occupied cell."""
    _, _, cell_of, counts = number_cells(points, origin, size)
    sums = np.zeros((counts.shape[0], 3), np.float64)
    for i in range(points.shape[0]):
        c = cell_of[i]
        sums[c, 0] += points[i, 0]
        sums[c, 1] += points[i, 1]
        sums[c, 2] += points[i, 2]
    means = np.empty((counts.shape[0], 3), np.float32)
    for c in range(counts.shape[0]):
        for a in range(3):
            means[c, a] = sums[c, a] / counts[c]
    return means, counts


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
    "Tuple((float32[:, ::1], float32[::1], float32[::1], int32[::1]))"
    "(float32[:, ::1], float32[:, ::1], int32[::1], int64[::1], int32[::1], float32[::1], float32)",
    cache=True,
    parallel=True,
)
def local_planes(queries, points, starts, keys, slots, origin, radius):
    """Plane through the points within `radius` (the cell size) of each query: (unit normals,
    surface variation = smallest eigenvalue / sum, standard deviation from the plane, number of
    points)."""
    n = queries.shape[0]
    normals = np.zeros((n, 3), np.float32)
    variation = np.ones(n, np.float32)
    thickness = np.full(n, radius)
    thickness = np.full(n, radius)
    counts = np.zeros(n, np.int32)
    mask = keys.shape[0] - 1
    limit = radius * radius
    for i in prange(n):
        qx, qy, qz = queries[i, 0], queries[i, 1], queries[i, 2]
        cx = np.int64((qx - origin[0]) / radius)
        cy = np.int64((qy - origin[1]) / radius)
        cz = np.int64((qz - origin[2]) / radius)
        m = np.zeros(6, np.float64)
        sx = sy = sz = np.float32(0.0)
        xx = xy = xz = yy = yz = zz = np.float32(0.0)
        k = 0
        for ix in range(max(cx - 1, 0), cx + 2):
            for iy in range(max(cy - 1, 0), cy + 2):
                for iz in range(max(cz - 1, 0), cz + 2):
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
    return normals, variation, thickness, counts


@njit(
    "Tuple((int32[::1], float32[::1]))"
    "(float32[:, ::1], float32[:, ::1], int32[::1], int64[::1], int32[::1], float32[::1], float32)",
    cache=True,
    parallel=True,
)
def nearest_within(queries, points, starts, keys, slots, origin, radius):
    """Row of the nearest point within `radius` (the cell size) of each query, or -1, and the
    squared distance."""
    n = queries.shape[0]
    nearest = np.full(n, np.int32(-1))
    squared = np.full(n, np.float32(np.inf))
    mask = keys.shape[0] - 1
    limit = radius * radius
    for i in prange(n):
        qx, qy, qz = queries[i, 0], queries[i, 1], queries[i, 2]
        fx = (qx - origin[0]) / radius
        fy = (qy - origin[1]) / radius
        fz = (qz - origin[2]) / radius
        if (
            fx < -1.0
            or fy < -1.0
            or fz < -1.0
            or fx > 2097150.0
            or fy > 2097150.0
            or fz > 2097150.0
        ):
            continue
        cx = np.int64(np.floor(fx))
        cy = np.int64(np.floor(fy))
        cz = np.int64(np.floor(fz))
        best = limit
        row = np.int32(-1)
        for ix in range(max(cx - 1, 0), cx + 2):
            for iy in range(max(cy - 1, 0), cy + 2):
                for iz in range(max(cz - 1, 0), cz + 2):
                    slot = find_slot(keys, cell_key(ix, iy, iz), mask)
                    if keys[slot] == -1:
                        continue
                    cell = slots[slot]
                    for j in range(starts[cell], starts[cell + 1]):
                        dx = points[j, 0] - qx
                        dy = points[j, 1] - qy
                        dz = points[j, 2] - qz
                        d = dx * dx + dy * dy + dz * dz
                        if d <= best:
                            best = d
                            row = np.int32(j)
        nearest[i] = row
        if row >= 0:
            squared[i] = best
    return nearest, squared
