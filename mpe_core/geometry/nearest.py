"""Nearest points of a fixed cloud."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from mpe_core.geometry.cell_list import CellList, Points, count_occupied
from mpe_core.geometry.sampling import take_every

MIN_TREE_REACH = 0.1
"""Reach, in radii of the cloud, from which on a k-d tree is faster than cells of that edge."""

DENSITY_CELL_EDGE = 0.03
"""Edge, in radii, of the cells that the density of a cloud is measured with."""

MIN_DENSITY_SAMPLE = 300_000
"""Points that the density is measured on; larger clouds are thinned to once or twice as many."""

POINTS_PER_CELL = 50
"""Mean number of points in a cell of the edge that suits a dense cloud (docs/tuning.md)."""

MIN_TWO_PASS_RATIO = 2.5
"""Reach over that edge from which on a first pass with small cells pays (docs/tuning.md)."""

REACH_REL_TOL, REACH_ABS_TOL = 1e-5, 1e-7
"""What a reach is widened by in cells, whose points are rounded to float32."""


class NearestNeighbors:
    """k-d tree of a cloud (M, 3), queried on as many threads as numba's kernels use."""

    def __init__(self, points: NDArray[np.float64]) -> None:
        self.points = points
        self._tree = KDTree(points, balanced_tree=False, compact_nodes=False)

    def nearest(
        self, points: NDArray[np.float64], reach: float = np.inf
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Find the nearest point of the cloud to each of points (N, 3).

        Returns
        -------
        (N,) distances and (N,) rows of the cloud; infinity and M where nothing lies within reach.
        """
        distance, row = self._tree.query(
            points, distance_upper_bound=reach, workers=numba.get_num_threads()
        )
        return np.asarray(distance), np.asarray(row, np.int64)

    def nearest_of(
        self, points: NDArray[np.float64], count: int
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return (N, count) distances and rows of the nearest points of the cloud, in order."""
        distance, row = self._tree.query(
            points, list(range(1, count + 1)), workers=numba.get_num_threads()
        )
        return np.asarray(distance), np.asarray(row, np.int64)


def nearest_rows(
    points: NDArray[np.float64], cloud: NDArray[np.float64], reach: float
) -> NDArray[np.int64]:
    """Find the row of the nearest point of a cloud for each of many points.

    Chooses the fastest of three ways: a k-d tree for a wide reach, one cell list, or two for a
    dense cloud.

    Parameters
    ----------
    points
        (N, 3) queries.
    cloud
        (M, 3) cloud of about radius 1.
    reach
        Largest distance, kept to about 1e-5 of itself.

    Returns
    -------
    (N,) rows of the cloud, -1 where none is within reach.
    """
    if reach > MIN_TREE_REACH:
        return _search_tree(points, cloud, reach)
    single, queries = cloud.astype(np.float32), points.astype(np.float32)
    cell_reach = reach * (1 + REACH_REL_TOL) + REACH_ABS_TOL
    edge = _dense_cell_edge(single)
    if cell_reach <= MIN_TWO_PASS_RATIO * edge:
        return CellList(single, cell_reach, max(cell_reach, edge)).nearest_rows(queries)
    return _search_two_passes(queries, single, cell_reach, edge)


def _search_tree(
    points: NDArray[np.float64], cloud: NDArray[np.float64], reach: float
) -> NDArray[np.int64]:
    _, row = NearestNeighbors(cloud).nearest(points, reach)
    return np.where(row < len(cloud), row, -1)


def _search_two_passes(
    queries: Points, cloud: Points, reach: float, edge: float
) -> NDArray[np.int64]:
    """Search small cells first, and the whole reach for the queries that found nothing there."""
    nearest = CellList(cloud, edge, edge).nearest_rows(queries)
    unmatched = np.flatnonzero(nearest < 0)
    if len(unmatched):
        wide = CellList(cloud, reach, reach)
        nearest[unmatched] = wide.nearest_rows(queries[unmatched])
    return nearest


def _dense_cell_edge(cloud: Points) -> float:
    """Return the edge of cells that hold POINTS_PER_CELL points on average."""
    sample = take_every(cloud, MIN_DENSITY_SAMPLE)
    cells = count_occupied(sample, DENSITY_CELL_EDGE)
    # on a surface the points in a cell go with the square of its edge
    return DENSITY_CELL_EDGE * float(np.sqrt(POINTS_PER_CELL * cells / len(cloud)))
