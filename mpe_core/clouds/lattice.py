"""Solids of voxels, as computed tomography gives them: only their boundary is a surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mpe_core.kernels.brute_force import nearest_distances

Array = NDArray[np.float64]

FEW_PROBES, PROBES = 5, 20
"""Points that are asked first, and then, before all are asked for their neighbours."""

NEIGHBOURS = 6
"""Neighbours of a voxel within a solid, all at one distance."""

LATTICE_TOL = 1e-3
"""Deviation of the distance between neighbours, over the distance."""

MIN_SOLID = 0.4
"""Share of the points within the solid from which on the cloud is one."""


def find_boundary(points: Array) -> NDArray[np.bool_] | None:
    """Find the boundary of a solid of voxels.

    Parameters
    ----------
    points
        (N, 3) points.

    Returns
    -------
    (N,) whether a voxel lacks one of its six neighbours; None if the cloud is no such solid.
    """
    if len(points) <= PROBES:
        return None
    edge = 0.0
    for count in (FEW_PROBES, PROBES):
        probes = np.linspace(0, len(points) - 1, count).astype(np.int64)
        nearest = _equally_near(points, probes)
        edge = float(np.median(nearest[:, 0]))
        share = _is_full(nearest, edge).mean()
        if edge == 0 or not share or (count == PROBES and share < MIN_SOLID):
            return None
    distances, _ = cKDTree(points).query(points, NEIGHBOURS + 1)
    boundary = ~_is_full(np.asarray(distances)[:, 1:], edge)
    return boundary if MIN_SOLID <= 1 - boundary.mean() < 1 else None


def _equally_near(points: Array, rows: NDArray[np.int64]) -> Array:
    """(K, 6) distances of the points nearest to some; infinite where they are unlike the least."""
    distances: Array = nearest_distances(points, rows, NEIGHBOURS)
    distances[distances > (1 + 3 * LATTICE_TOL) * distances[:, :1]] = np.inf
    return distances


def _is_full(distances: Array, edge: float) -> NDArray[np.bool_]:
    """(N,) whether all distances (N, 6) are one edge."""
    is_edge = np.abs(distances - edge) <= LATTICE_TOL * edge
    return np.asarray(is_edge.all(axis=1), np.bool_)
