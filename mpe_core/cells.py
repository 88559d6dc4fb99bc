"""Points in cubes: thinning, nearest points within reach, planes through neighbourhoods."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.kernels.cells import (
    cell_means,
    local_planes,
    nearest_within,
    number_cells,
    sort_by_cell,
)

Points = NDArray[np.float32]

LARGEST_GRID = 2.0**21 - 8
"""Cells along an axis that a 64-bit key can tell apart."""


def least_cell(points: Points, size: float) -> np.float32:
    """The cell size asked for, or the smallest that numbers every cell of these points (N, 3)."""
    extent = float((points.max(axis=0) - points.min(axis=0)).max())
    return np.float32(max(size, extent / LARGEST_GRID))


def thin(points: Points, size: float) -> Points:
    """(K, 3) means of the points (N, 3) in each occupied cube of edge `size`, in order of
    appearance."""
    means: Points = cell_means(points, points.min(axis=0), least_cell(points, size))[0]
    return means


class CellList:
    """A fixed cloud (M, 3) in cubes of edge `reach`, asked for what lies within reach of any
    point."""

    def __init__(self, points: Points, reach: float) -> None:
        self.reach = least_cell(points, reach)
        self._origin = points.min(axis=0)
        self._keys, self._slots, cell_of, counts = number_cells(points, self._origin, self.reach)
        self.points, self._starts, self.rows = sort_by_cell(points, cell_of, counts)
        """The cloud in cell order (M, 3), and the row of the given cloud that each came from."""

    def nearest(self, queries: Points) -> tuple[NDArray[np.int32], Points]:
        """(N,) rows of `points` nearest to queries (N, 3) and their squared distances; -1 and
        infinity where nothing is within reach."""
        row, squared = nearest_within(
            queries, self.points, self._starts, self._keys, self._slots, self._origin, self.reach
        )
        return row, squared

    def planes(self, queries: Points) -> tuple[Points, Points, Points, NDArray[np.int32]]:
        """Plane through the points within reach of each query (N, 3): unit normals (N, 3) of either
        sign, the smallest eigenvalue of their covariance over its trace (N,), their standard
        deviation from the plane (N,) and their count (N,). Fewer than 5 points give a zero
        normal."""
        normals, variation, thickness, counts = local_planes(
            queries, self.points, self._starts, self._keys, self._slots, self._origin, self.reach
        )
        return normals, variation, thickness, counts
