"""Planes through the neighborhoods of points, found with cell lists."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.cell_list import CELLS, NEIGHBOR_STEPS, column_run, locate

MIN_PLANE_POINTS = 5
"""Fewest points that a plane is fitted to."""


@njit(
    "UniTuple(float64, 4)(float64, float64, float64, float64, float64, float64)",
    cache=True,
    error_model="numpy",
)
def smallest_eigenvector(xx, xy, xz, yy, yz, zz):
    """Find the smallest eigenvalue of a symmetric 3x3 matrix in closed form (Smith 1961).

    Returns
    -------
    Its unit eigenvector, and the eigenvalue.
    """
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    p = np.sqrt((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if p <= 1e-16:
        return 0.0, 0.0, 1.0, mean
    a, b, c, d, e, f = a / p, b / p, c / p, xy / p, xz / p, yz / p
    half_det = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))
    phi = np.arccos(min(1.0, max(-1.0, half_det))) / 3.0
    low = mean + 2.0 * p * np.cos(phi + 2.0943951023931953)
    # rows of (M - low I) span the plane of the other two axes: their cross product is the axis,
    # and the longest one is the most exact
    ax, ay, az, longest = 0.0, 0.0, 1.0, -1.0
    rows = ((xx - low, xy, xz), (xy, yy - low, yz), (xz, yz, zz - low))
    for k in range(3):
        (ux, uy, uz), (vx, vy, vz) = rows[k], rows[(k + 1) % 3]
        cx, cy, cz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = cx * cx + cy * cy + cz * cz
        if length > longest:
            ax, ay, az, longest = cx, cy, cz, length
    scale = 1.0 / np.sqrt(max(longest, 1e-300))
    return ax * scale, ay * scale, az * scale, low


@njit(
    "UniTuple(float32, 10)(float32, float32, float32, float32, float32[::1], float32[::1],"
    " float32[::1])",
    cache=True,
    fastmath=True,
)
def neighborhood_moments(qx, qy, qz, limit, px, py, pz):
    """Return the moments of the points px, py, pz around a query.

    Returns
    -------
    Count, sums (x, y, z) and sums of products (xx, xy, xz, yy, yz, zz) of the offsets from the
    query whose squared length is at most `limit`.
    """
    k = sx = sy = sz = np.float32(0.0)
    xx = xy = xz = yy = yz = zz = np.float32(0.0)
    # a function of its own, without a branch: inside prange the compiler would not vectorize it
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
    "Tuple((float32[:, ::1], float32[::1], float32[::1], int32[::1], float32[::1], float32[::1]))"
    f"(float32[:, ::1], float32, {CELLS})",
    cache=True,
    parallel=True,
)
def local_planes(queries, radius, cells):
    """Fit a plane to the points within `radius` of each query (N, 3).

    Parameters
    ----------
    queries
        (N, 3) places.
    radius
        Radius of the neighborhoods, at most the edge of the cells.
    cells
        Cell list of the points, as `CELLS`.

    Returns
    -------
    (N, 3) unit normals, zero where there are fewer than MIN_PLANE_POINTS points.
    (N,) surface variation: smallest eigenvalue of the covariance over its trace.
    (N,) standard deviation of the points from the plane.
    (N,) number of points.
    (N,) distance of the plane from the query along the normal.
    (N,) distance of the points' mean from the query along the plane.
    """
    n = queries.shape[0]
    normals = np.zeros((n, 3), np.float32)
    surface_variation = np.ones(n, np.float32)
    plane_std = np.full(n, radius)
    counts = np.zeros(n, np.int32)
    offsets = np.zeros(n, np.float32)
    mean_shifts = np.zeros(n, np.float32)
    limit = radius * radius
    columns = cells[0]
    x, y, z = columns[0], columns[1], columns[2]
    for i in prange(n):
        qx, qy, qz = queries[i, 0], queries[i, 1], queries[i, 2]
        place = locate(qx, qy, qz, cells)
        k = sx = sy = sz = np.float32(0.0)
        xx = xy = xz = yy = yz = zz = np.float32(0.0)
        for step_x in NEIGHBOR_STEPS:
            for step_y in NEIGHBOR_STEPS:
                a, b = column_run(place, step_x, step_y, limit, cells)
                if a < b:
                    m = neighborhood_moments(qx, qy, qz, limit, x[a:b], y[a:b], z[a:b])
                    k, sx, sy, sz = k + m[0], sx + m[1], sy + m[2], sz + m[3]
                    xx, xy, xz = xx + m[4], xy + m[5], xz + m[6]
                    yy, yz, zz = yy + m[7], yz + m[8], zz + m[9]
        counts[i] = np.int32(k)
        if counts[i] >= MIN_PLANE_POINTS:
            share = 1.0 / k
            mx, my, mz = sx * share, sy * share, sz * share
            vx, vy, vz = xx * share - mx * mx, yy * share - my * my, zz * share - mz * mz
            ax, ay, az, low = smallest_eigenvector(
                vx, xy * share - mx * my, xz * share - mx * mz, vy, yz * share - my * mz, vz
            )
            low = max(low, 0.0)
            normals[i, 0], normals[i, 1], normals[i, 2] = ax, ay, az
            surface_variation[i] = low / max(vx + vy + vz, 1e-30)
            plane_std[i] = np.sqrt(low)
            offsets[i] = mx * ax + my * ay + mz * az
            across = mx * mx + my * my + mz * mz - offsets[i] * offsets[i]
            mean_shifts[i] = np.sqrt(max(across, 0.0))
    return normals, surface_variation, plane_std, counts, offsets, mean_shifts
