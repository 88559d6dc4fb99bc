"""Nearest points of a fixed cloud."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from mpe_core.cells import CellList, cube_order
from mpe_core.kernels.rows import points_at, rows_as_given


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

CROWDED, ROOMY = 64, 24
"""Points a cube from which on a first look in smaller cubes, of that many points, pays. 10 million
points onto 10 million, both in random order, seconds of CPU time: 150 points a cube 11.8 without
it, 6.0 / 5.5 / 6.1 with it and 12 / 24 / 40; 38 points a cube 6.1 without it, 6.5 with it and
12."""

BLOCK = 8
"""Edge of a cube of queries over that of the cloud's. The same clouds took 54 s of CPU time with
the queries as they came and 25 s cube by cube."""


def nearest_rows(
    points: NDArray[np.float64], cloud: NDArray[np.float64], reach: float
) -> NDArray[np.int64]:
    """(N,) rows of the cloud (M, 3) nearest to points (N, 3); -1 where none is within about
    reach."""
    if reach > WIDE_REACH:
        _, row = Neighbours(cloud).nearest(points, reach)
        return np.where(row < len(cloud), row, -1)
    single, queries = cloud.astype(np.float32), points.astype(np.float32)
    edge = reach * (1 + 1e-5) + 1e-7
    cells = CellList(single, edge)
    crowd = len(cloud) / cells.count
    if crowd <= CROWDED:
        return _rows(cells, queries)
    # on a surface the points in a cube go with the square of its edge
    nearest = _rows(CellList(single, edge * float(np.sqrt(ROOMY / crowd))), queries)
    alone = np.flatnonzero(nearest < 0)
    nearest[alone] = _rows(cells, queries[alone])
    return nearest


def _rows(cells: CellList, queries: NDArray[np.float32]) -> NDArray[np.int64]:
    """(N,) rows of the cloud nearest to queries (N, 3), or -1, asked cube by cube: what lies around
    a cube stays in the processor's cache."""
    if not len(queries):
        return np.empty(0, np.int64)
    order = cube_order(queries, BLOCK * float(cells.reach))
    row, _ = cells.nearest(points_at(queries, order))
    nearest: NDArray[np.int64] = rows_as_given(row, cells.rows, order)
    return nearest
