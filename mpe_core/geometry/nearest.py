"""Nearest points of a fixed cloud."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from mpe_core.geometry.cell_list import CellList, count_occupied


class NearestNeighbors:
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

ROOMY = 50
"""Points a cube that suit a search, on a surface. A million points of a tube onto as many, in cubes
of 6 / 12 / 24 / 50 / 80: 89 / 70 / 59 / 53 / 51 ms; 10 million 1.7 / 1.3 / 0.96 / 0.80 / 0.84 s."""

WIDER = 2.5
"""Reach over the edge of such cubes from which on a first look in these pays. A million points with
2.5: 0.14 s without it and 0.084 with it, but 0.16 and 0.24 where half of them have nothing within
reach; with 3.8 0.26 and 0.083, 0.23 and 0.24."""

PROBED = 300_000
"""Points, or up to twice as many, that the density is told from."""


def nearest_rows(
    points: NDArray[np.float64], cloud: NDArray[np.float64], reach: float
) -> NDArray[np.int64]:
    """(N,) rows of the cloud (M, 3) nearest to points (N, 3); -1 where none is within about
    reach."""
    if reach > WIDE_REACH:
        _, row = NearestNeighbors(cloud).nearest(points, reach)
        return np.where(row < len(cloud), row, -1)
    single, queries = cloud.astype(np.float32), points.astype(np.float32)
    within = reach * (1 + 1e-5) + 1e-7
    some = single[:: max(1, len(single) // PROBED)].copy()
    # on a surface the points in a cube go with the square of its edge
    roomy = PROBE * float(np.sqrt(ROOMY * count_occupied(some, PROBE) / len(single)))
    if within <= WIDER * roomy:
        return CellList(single, within, max(within, roomy)).nearest_given(queries)
    nearest = CellList(single, roomy, roomy).nearest_given(queries)
    alone = np.flatnonzero(nearest < 0)
    if len(alone):
        nearest[alone] = CellList(single, within, within).nearest_given(queries[alone])
    return nearest
