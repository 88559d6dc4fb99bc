"""A lattice that names the nearest reference point of every cell: one array read instead of a tree
query."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

FAR = np.int32(1 << 28)


@njit("void(int32[::1], int32[::1], int64)", cache=True)
def lower_envelope(squared, feature, n):
    """One line of the exact Euclidean distance transform (Felzenszwalb and Huttenlocher 2012), in
    place: squared distances in cells^2, with the feature that attains each."""
    sites = np.empty(n, np.int64)
    bounds = np.empty(n + 1, np.float64)
    heights = np.empty(n, np.int64)
    features = np.empty(n, np.int32)
    k = -1
    for q in range(n):
        if squared[q] >= FAR:
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


@njit(
    "int32[:, :, ::1](float32[:, ::1], float32[::1], float32, int64[::1])",
    cache=True,
    parallel=True,
)
def nearest_index(points, origin, size, shape):
    """For each cell the index of the point whose cell is nearest (exact between cell centres)."""
    nx, ny, nz = shape[0], shape[1], shape[2]
    squared = np.full((nx, ny, nz), FAR)
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
        line = np.empty(ny, np.int32)
        names = np.empty(ny, np.int32)
        for y in range(ny):
            lower_envelope(squared[x, y], feature[x, y], nz)
        for z in range(nz):
            for y in range(ny):
                line[y] = squared[x, y, z]
                names[y] = feature[x, y, z]
            lower_envelope(line, names, ny)
            for y in range(ny):
                squared[x, y, z] = line[y]
                feature[x, y, z] = names[y]
    for y in prange(ny):
        line = np.empty(nx, np.int32)
        names = np.empty(nx, np.int32)
        for z in range(nz):
            for x in range(nx):
                line[x] = squared[x, y, z]
                names[x] = feature[x, y, z]
            lower_envelope(line, names, nx)
            for x in range(nx):
                feature[x, y, z] = names[x]
    return feature
