"""Exact Euclidean distance transform of a cloud, with the nearest point of every cell.

A query of the nearest point becomes one array read.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

UNREACHED = np.int32(1 << 28)
"""Squared distance, in cells, of a cell that no point has reached yet."""


@njit("void(int32[::1], int32[::1], int64)", cache=True)
def lower_envelope(squared, feature, n):
    """Transform the first n cells of a line in place (Felzenszwalb and Huttenlocher 2012).

    Parameters
    ----------
    squared
        Squared distances, in cells; replaced by the lower envelope of the parabolas on them.
    feature
        Index of the point that attains each.
    """
    sites = np.empty(n, np.int64)
    bounds = np.empty(n + 1, np.float64)
    heights = np.empty(n, np.int64)
    features = np.empty(n, np.int32)
    k = -1
    for q in range(n):
        if squared[q] >= UNREACHED:
            continue
        h = np.int64(squared[q]) + q * q
        start = -1e300
        while k >= 0:
            start = (h - heights[k]) / (2.0 * (q - sites[k]))
            if start > bounds[k]:
                break
            k -= 1
            start = -1e300
        k += 1
        sites[k] = q
        heights[k] = h
        features[k] = feature[q]
        bounds[k] = start
    if k < 0:
        return
    j = 0
    for q in range(n):
        while j < k and bounds[j + 1] < q:
            j += 1
        squared[q] = np.int32((q - sites[j]) * (q - sites[j]) + heights[j] - sites[j] * sites[j])
        feature[q] = features[j]


@njit("void(int32[:], int32[:])", cache=True)
def transform_line(squared, feature):
    """Apply `lower_envelope` to a line of any stride, in place."""
    line, names = squared.copy(), feature.copy()
    lower_envelope(line, names, line.shape[0])
    squared[:] = line
    feature[:] = names


@njit(
    "int32[:, :, ::1](float32[:, ::1], float32[::1], float32, int64[::1])",
    cache=True,
    parallel=True,
)
def nearest_point_index(points, origin, size, shape):
    """Find for each cell of a lattice the point whose cell is nearest.

    The distance is that between the centers of the cells, and exact. Of several points in a cell
    the one nearest to its center stands for it.

    Parameters
    ----------
    points
        (N, 3) points, all of them inside the lattice.
    origin, size
        Corner (3,) of the lattice and edge of its cells.
    shape
        (3,) number of cells along each axis.

    Returns
    -------
    (nx, ny, nz) rows of `points`.
    """
    nx, ny, nz = shape[0], shape[1], shape[2]
    squared = np.full((nx, ny, nz), UNREACHED)
    feature = np.full((nx, ny, nz), np.int32(-1))
    offset = np.full((nx, ny, nz), np.float32(np.inf))
    for i in range(points.shape[0]):
        fx = (points[i, 0] - origin[0]) / size
        fy = (points[i, 1] - origin[1]) / size
        fz = (points[i, 2] - origin[2]) / size
        cx, cy, cz = np.int64(fx), np.int64(fy), np.int64(fz)
        d = (fx - cx - 0.5) ** 2 + (fy - cy - 0.5) ** 2 + (fz - cz - 0.5) ** 2
        if d < offset[cx, cy, cz]:
            offset[cx, cy, cz] = d
            squared[cx, cy, cz] = 0
            feature[cx, cy, cz] = i
    for x in prange(nx):
        for y in range(ny):
            lower_envelope(squared[x, y], feature[x, y], nz)
        for z in range(nz):
            transform_line(squared[x, :, z], feature[x, :, z])
    for y in prange(ny):
        for z in range(nz):
            transform_line(squared[:, y, z], feature[:, y, z])
    return feature
