"""Planes through the neighborhoods of points, found with cell lists."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.cell_list import CELLS, NEIGHBOR_STEPS, column_run, locate

MIN_PLANE_POINTS = 5
"""Fewest points that a plane is fitted to."""

MIN_SPREAD = 1e-16
"""Spread of the eigenvalues up to which all axes are alike."""

BLOCK = 64
"""Queries whose moments are summed before their planes are fitted (docs/tuning.md)."""


@njit(
    "void(float64[:, ::1], float64[:, ::1])",
    cache=True,
    fastmath={"contract"},
    error_model="numpy",
)
def smallest_eigenvectors(matrices, axes):
    """Find the smallest eigenvalues of symmetric 3x3 matrices in closed form (Smith 1961).

    Parameters
    ----------
    matrices
        (6, N) upper triangles: xx, xy, xz, yy, yz, zz.
    axes
        (4, N) is overwritten by the unit eigenvectors and, in the last row, the eigenvalues.
    """
    # loops over columns, without a branch: the compiler turns all but the one with the cosines into
    # vector instructions
    n = matrices.shape[1]
    xx, xy, xz = matrices[0], matrices[1], matrices[2]
    yy, yz, zz = matrices[3], matrices[4], matrices[5]
    x, y, z, low = axes[0], axes[1], axes[2], axes[3]
    mean, spread, half_det = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        mean[i] = (xx[i] + yy[i] + zz[i]) / 3.0
        a, b, c, d, e, f = xx[i] - mean[i], yy[i] - mean[i], zz[i] - mean[i], xy[i], xz[i], yz[i]
        p = np.sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0)
        share = 1.0 / max(p, MIN_SPREAD)
        a, b, c, d, e, f = a * share, b * share, c * share, d * share, e * share, f * share
        half = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))
        spread[i], half_det[i] = p, min(1.0, max(-1.0, half))
    for i in range(n):
        angle = np.arccos(half_det[i]) / 3.0 + 2.0943951023931953
        low[i] = mean[i] + 2.0 * spread[i] * np.cos(angle)
    for i in range(n):
        # rows of (M - low I) span the plane of the other two axes: their cross product is the axis,
        # and the longest one is the most exact
        a, b, c, d, e, f = xx[i] - low[i], yy[i] - low[i], zz[i] - low[i], xy[i], xz[i], yz[i]
        ux, uy, uz = d * f - e * b, e * d - a * f, a * b - d * d
        vx, vy, vz = b * c - f * f, f * e - d * c, d * f - b * e
        wx, wy, wz = f * e - c * d, c * a - e * e, e * d - f * a
        u, v, w = (
            ux * ux + uy * uy + uz * uz,
            vx * vx + vy * vy + vz * vz,
            wx * wx + wy * wy + wz * wz,
        )
        ux, uy, uz, u = (vx, vy, vz, v) if v > u else (ux, uy, uz, u)
        ux, uy, uz, u = (wx, wy, wz, w) if w > u else (ux, uy, uz, u)
        scale, is_ball = 1.0 / np.sqrt(max(u, 1e-300)), spread[i] <= MIN_SPREAD
        x[i] = 0.0 if is_ball else ux * scale
        y[i] = 0.0 if is_ball else uy * scale
        z[i] = 1.0 if is_ball else uz * scale


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
    "void(float32[:, ::1], float32[:, ::1], float32[::1], float32[::1], int32[::1], float32[::1],"
    " float32[::1])",
    cache=True,
    fastmath={"contract"},
    error_model="numpy",
)
def planes_of_moments(moments, normals, variation, plane_std, counts, offsets, mean_shifts):
    """Fit planes to neighborhoods with the moments (10, N or more) of `neighborhood_moments`.

    The others, (N, 3) and (N,), are overwritten by what `local_planes` returns; what belongs to
    fewer than MIN_PLANE_POINTS points is left.
    """
    n = counts.shape[0]
    k, sx, sy, sz = moments[0], moments[1], moments[2], moments[3]
    covariances, axes = np.empty((6, n)), np.empty((4, n))
    xx, xy, xz = covariances[0], covariances[1], covariances[2]
    yy, yz, zz = covariances[3], covariances[4], covariances[5]
    for i in range(n):
        share = 1.0 / max(k[i], np.float32(1.0))
        mx, my, mz = sx[i] * share, sy[i] * share, sz[i] * share
        xx[i] = moments[4, i] * share - mx * mx
        xy[i] = moments[5, i] * share - mx * my
        xz[i] = moments[6, i] * share - mx * mz
        yy[i] = moments[7, i] * share - my * my
        yz[i] = moments[8, i] * share - my * mz
        zz[i] = moments[9, i] * share - mz * mz
    smallest_eigenvectors(covariances, axes)
    for i in range(n):
        counts[i] = np.int32(k[i])
        if counts[i] >= MIN_PLANE_POINTS:
            share = 1.0 / k[i]
            mx, my, mz = sx[i] * share, sy[i] * share, sz[i] * share
            ax, ay, az, low = axes[0, i], axes[1, i], axes[2, i], max(axes[3, i], 0.0)
            normals[i, 0], normals[i, 1], normals[i, 2] = ax, ay, az
            variation[i] = low / max(xx[i] + yy[i] + zz[i], 1e-30)
            plane_std[i] = np.sqrt(low)
            offsets[i] = mx * ax + my * ay + mz * az
            across = mx * mx + my * my + mz * mz - offsets[i] * offsets[i]
            mean_shifts[i] = np.sqrt(max(across, 0.0))


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
    for block in prange((n + BLOCK - 1) // BLOCK):
        first, last = block * BLOCK, min(n, (block + 1) * BLOCK)
        moments = np.empty((10, BLOCK), np.float32)
        for i in range(first, last):
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
            sums = (k, sx, sy, sz, xx, xy, xz, yy, yz, zz)
            for r in range(10):
                moments[r, i - first] = sums[r]
        planes_of_moments(
            moments,
            normals[first:last],
            surface_variation[first:last],
            plane_std[first:last],
            counts[first:last],
            offsets[first:last],
            mean_shifts[first:last],
        )
    return normals, surface_variation, plane_std, counts, offsets, mean_shifts
