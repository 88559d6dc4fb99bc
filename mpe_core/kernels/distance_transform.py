"""Exact Euclidean distance transform of a cloud, with the nearest point of every cell.

A query of the nearest point becomes one array read.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

UNREACHED = np.int32(1 << 28)
"""Squared distance, in cells, of a cell that no point has reached yet."""


HULL = "Tuple((int64[::1], int64[::1], int32[::1], float64[::1]))"
"""Memory for the parabolas of a lower envelope: their apexes, heights and features, and where each
begins."""


@njit(f"{HULL}(int64)", cache=True)
def empty_hull(n):
    """Return memory for lines of up to n cells."""
    return np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int32), np.empty(n + 1)


@njit(f"void(int32[:], int32[:], {HULL})", cache=True, error_model="numpy")
def lower_envelope(squared, feature, hull):
    """Transform a line of cells in place (Felzenszwalb and Huttenlocher 2012).

    Parameters
    ----------
    squared
        (n,) squared distances, in cells; replaced by the lower envelope of the parabolas on them.
    feature
        (n,) index of the point that attains each.
    hull
        Memory that is overwritten, see `empty_hull`.
    """
    sites, heights, features, begins = hull
    k = -1
    for q in range(squared.shape[0]):
        if squared[q] >= UNREACHED:
            continue
        h = np.int64(squared[q]) + q * q
        begin = -1e300
        while k >= 0:
            begin = (h - heights[k]) / (2.0 * (q - sites[k]))
            if begin > begins[k]:
                break
            k -= 1
            begin = -1e300
        k += 1
        sites[k], heights[k], features[k], begins[k] = q, h, feature[q], begin
    if k < 0:
        return
    j = 0
    for q in range(squared.shape[0]):
        while j < k and begins[j + 1] < q:
            j += 1
        squared[q] = np.int32((q - sites[j]) * (q - sites[j]) + heights[j] - sites[j] * sites[j])
        feature[q] = features[j]


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
    offsets = np.empty(points.shape[0], np.float32)
    for i in range(points.shape[0]):
        fx = (points[i, 0] - origin[0]) / size
        fy = (points[i, 1] - origin[1]) / size
        fz = (points[i, 2] - origin[2]) / size
        cx, cy, cz = np.int64(fx), np.int64(fy), np.int64(fz)
        offsets[i] = (fx - cx - 0.5) ** 2 + (fy - cy - 0.5) ** 2 + (fz - cz - 0.5) ** 2
        held = feature[cx, cy, cz]
        if held < 0 or offsets[i] < offsets[held]:
            squared[cx, cy, cz] = 0
            feature[cx, cy, cz] = i
    for x in prange(nx):
        hull = empty_hull(max(ny, nz))
        for y in range(ny):
            lower_envelope(squared[x, y], feature[x, y], hull)
        for z in range(nz):
            lower_envelope(squared[x, :, z], feature[x, :, z], hull)
    for y in prange(ny):
        hull = empty_hull(nx)
        for z in range(nz):
            lower_envelope(squared[:, y, z], feature[:, y, z], hull)
    return feature
