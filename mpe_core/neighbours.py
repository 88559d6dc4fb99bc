"""Nearest points of a fixed cloud."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from mpe_core.cells import CellList, crowd, cube_order
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

PROBE = 0.03
"""Edge in radii of the cubes that tell how dense a cloud is."""

ROOMY = 30
"""Points a cube that suit a search, on a surface. 40,000 points of the bunny onto as many within
0.005 radii: 9.4 ms in cubes of that edge, which hold one point; 3.8 / 3.6 / 3.5 / 2.9 / 3.3 with 6
/ 12 / 24 / 36 / 50. 10 million points onto 10 million, both in random order, seconds of CPU time:
10.3 in cubes of 220 points, 5.4 / 4.9 / 4.4 with 12 / 24 / 36."""

WIDER = 1.6
"""Reach over the edge of such cubes from which on a first look in these pays. 3 million points, 70
a cube of the reach (1.5 times the edge): 1.4 s of CPU time without it, 1.0 with it; 28 a cube: 1.0
without it, 1.3 with it."""

LARGE = 100_000
"""Queries from which on they are asked cube by cube: 40,000 take as long as they come, 72,000 of a
LiDAR scan 8.5 ms and 7.0, in which to sort them takes 1."""

BLOCK = 8
"""Edge of a cube of queries over that of the cloud's. 10 million points onto 10 million took 54 s
of CPU time with the queries as they came and 25 s cube by cube."""


def nearest_rows(
    points: NDArray[np.float64], cloud: NDArray[np.float64], reach: float
) -> NDArray[np.int64]:
    """(N,) rows of the cloud (M, 3) nearest to points (N, 3); -1 where none is within about
    reach."""
    if reach > WIDE_REACH:
        _, row = Neighbours(cloud).nearest(points, reach)
        return np.where(row < len(cloud), row, -1)
    single, queries = cloud.astype(np.float32), points.astype(np.float32)
    within = reach * (1 + 1e-5) + 1e-7
    # on a surface the points in a cube go with the square of its edge
    roomy = PROBE * float(np.sqrt(ROOMY / crowd(single, PROBE)))
    if within <= WIDER * roomy:
        return _rows(CellList(single, max(within, roomy)), queries, within)
    nearest = _rows(CellList(single, roomy), queries, within)
    alone = np.flatnonzero(nearest < 0)
    if len(alone):
        nearest[alone] = _rows(CellList(single, within), queries[alone], within)
    return nearest


def _rows(cells: CellList, queries: NDArray[np.float32], within: float) -> NDArray[np.int64]:
    """(N,) rows of the cloud nearest to queries (N, 3), or -1; many are asked cube by cube: what
    lies around a cube stays in the processor's cache."""
    if len(queries) < LARGE:
        order = np.arange(len(queries), dtype=np.int32)
    else:
        order = cube_order(queries, BLOCK * float(cells.reach))
    row, _ = cells.nearest(points_at(queries, order), within)
    nearest: NDArray[np.int64] = rows_as_given(row, cells.rows, order)
    return nearest
