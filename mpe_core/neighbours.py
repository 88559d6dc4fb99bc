"""Nearest points of a fixed cloud."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from mpe_core.cells import CellList


class Neighbours:
    """k-d tree of a cloud (M, 3), asked on as many threads as numba's kernels use."""

    def __init__(self, points: NDArray[np.float64]) -> None:
        self.points = points
        self._tree = KDTree(points, balanced_tree=False, compact_nodes=False)

    def nearest(
        self, points: NDArray[np.float64], reach: float = np.inf
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """(N,) distances from points (N, 3) to their nearest points of the cloud, and (N,) rows.

        Where nothing lies within reach: infinity and M.
        """
        distance, row = self._tree.query(
            points, distance_upper_bound=reach, workers=numba.get_num_threads()
        )
        return np.asarray(distance), np.asarray(row, np.int64)


WIDE_REACH = 0.1
"""Reach in radii of the cloud from which on a k-d tree is quicker than cubes of that edge."""


def nearest_rows(
    points: NDArray[np.float64], cloud: NDArray[np.float64], reach: float
) -> NDArray[np.int64]:
    """(N,) rows of the cloud (M, 3) nearest to points (N, 3); -1 where none is within about
    reach."""
    if reach > WIDE_REACH:
        _, row = Neighbours(cloud).nearest(points, reach)
        return np.where(row < len(cloud), row, -1)
    cells = CellList(cloud.astype(np.float32), reach * (1 + 1e-5) + 1e-7)
    row32, _ = cells.nearest(points.astype(np.float32))
    return np.where(row32 >= 0, cells.rows[row32], -1).astype(np.int64)
