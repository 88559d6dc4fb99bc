"""Clouds in cubic cells: downsampling, nearest points within reach, local planes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpe_core.kernels.bounds import bounding_box
from mpe_core.kernels.buckets import partition
from mpe_core.kernels.cell_list import MAX_CELL_INDEX, nearest_within
from mpe_core.kernels.cell_table import (
    LARGE_TABLE_SLOTS,
    SMALL_TABLE_SLOTS,
    bucket_cell_means,
    build_table,
    number_cells,
    sort_bucket_cells,
)
from mpe_core.kernels.local_planes import local_planes
from mpe_core.kernels.point_rows import gather_columns, restore_order

Points = NDArray[np.float32]
Grid = tuple[Points, np.float32]
"""Origin (3,) and edge of cubic cells."""

CELL_EDGE_FACTOR = 2.0
"""Edge of the cells of a cell list over the reach of its queries. Larger cells come in fewer runs
of more points, which suits planes best (docs/tuning.md)."""

MAX_MEAN_SHIFT = 0.22
"""Distance of the neighbours' mean from a point, in radii of the neighbourhood, from which on the
point lies at a border: half a disc has 0.42 (docs/tuning.md)."""

MIN_SHAPE_POINTS = 15
"""Neighbours from which on the surface variation tells shape: that of fewer is smaller, and so
tells how densely a scanner measured (docs/tuning.md)."""

MIN_BUCKETED_POINTS = 200_000
"""Points from which on sorting them by bucket pays for nearest-point queries (docs/tuning.md)."""


def fit_grid(points: Points, size: float) -> Grid:
    """Return the grid of cells of edge `size` over points (N, 3).

    The edge grows for a cloud so wide that its cells could not be numbered.
    """
    low, high = bounding_box(points)
    edge = max(size, float((high - low).max()) / (MAX_CELL_INDEX - 2))
    return low, np.float32(edge)


def bucket_order(points: Points, grid: Grid) -> tuple[Points, NDArray[np.int32], NDArray[np.int64]]:
    """Sort a large cloud so that points close in space are close in memory.

    Returns
    -------
    (N, 3) the points in their new order; unchanged below MIN_BUCKETED_POINTS.
    (N,) the row that each came from.
    (buckets + 1,) bounds of the buckets, which divide no cell of the grid.
    """
    if len(points) >= MIN_BUCKETED_POINTS:
        ordered, rows = np.empty_like(points), np.empty(len(points), np.int32)
        return ordered, rows, partition(points, grid, ordered, rows)
    return points, np.arange(len(points), dtype=np.int32), np.array([0, len(points)])


def voxel_downsample(points: Points, size: float) -> Points:
    """Return the (K, 3) means of points (N, 3) in each occupied cell of edge `size`."""
    grid = fit_grid(points, size)
    ordered, _, bounds = bucket_order(points, grid)
    means: Points = bucket_cell_means(ordered, bounds, grid)
    return means


def voxel_downsample_weighted(
    points: Points, weights: NDArray[np.float64], size: float
) -> tuple[Points, Points]:
    """Return weighted means of points (N, 3) in each occupied cell of edge `size`.

    Returns
    -------
    (K, 3) weighted means, and (K,) mean weight of the points in each cell.
    """
    _, cell, counts = number_cells(points, fit_grid(points, size), LARGE_TABLE_SLOTS)
    total = np.bincount(cell, weights)
    moments = [np.bincount(cell, weights * column) for column in points.T]
    means: Points = np.ascontiguousarray((moments / total).T, np.float32)
    return means, (total / counts).astype(np.float32)


def count_occupied(points: Points, size: float) -> int:
    """Count the cells of edge `size` that hold any of the points (N, 3)."""
    _, _, counts = number_cells(points, fit_grid(points, size), SMALL_TABLE_SLOTS)
    return len(counts)


@dataclass(frozen=True, slots=True)
class LocalPlanes:
    """Planes through the neighborhoods of queries (N, 3).

    Fewer than 5 points give a zero normal and an offset of 0.
    """

    normals: Points
    """(N, 3) unit normals of either sign."""
    surface_variation: Points
    """(N,) smallest eigenvalue of the points' covariance over its trace."""
    plane_std: Points
    """(N,) standard deviation of the points from the plane."""
    counts: NDArray[np.int32]
    """(N,) number of points in the neighborhood."""
    offsets: Points
    """(N,) distance of the plane from the query along the normal."""
    mean_shifts: Points
    """(N,) distance of the points' mean from the query along the plane: at the border of a cloud
    all neighbours lie to one side."""

    def comparable_variation(self, radius: float) -> Points:
        """(N,) surface variation; NaN at the border of the cloud, and where few points lie."""
        unsure = (self.mean_shifts > MAX_MEAN_SHIFT * radius) | (self.counts < MIN_SHAPE_POINTS)
        return np.where(unsure, np.float32(np.nan), self.surface_variation)

    def project(self, queries: Points) -> Points:
        """Return the queries (N, 3) projected onto their planes."""
        projected: Points = queries + self.offsets[:, None] * self.normals
        return projected


class CellList:
    """A fixed cloud (M, 3) in cells, for queries within a reach."""

    def __init__(self, points: Points, reach: float, edge: float | None = None) -> None:
        """Sort the cloud into cells.

        Parameters
        ----------
        points
            (M, 3) the cloud.
        reach
            Largest distance that a query asks for; grows for a cloud too wide for cells of that
            edge, see the attribute `reach`.
        edge
            Edge of the cells, at least the reach; CELL_EDGE_FACTOR times that if it is not given.
        """
        origin, self.reach = fit_grid(points, reach)
        edge = CELL_EDGE_FACTOR * reach if edge is None else edge
        self._grid = origin, max(self.reach, np.float32(edge))
        ordered, rows, bounds = bucket_order(points, self._grid)
        keys, self.starts, order = sort_bucket_cells(ordered, bounds, self._grid)
        self.rows = rows.take(order)
        """(M,) row of the given cloud of each row of `points`. The points of cell c are the rows
        starts[c]:starts[c + 1] of `points`."""
        self._columns = np.empty((3, len(points)), np.float32)
        gather_columns(ordered, order, self._columns)
        self.arrays = self._columns, self.starts, *build_table(keys), *self._grid
        """The cell list as the kernels take it, their `CELLS`."""

    @cached_property
    def points(self) -> Points:
        """(M, 3) the cloud in the order of its cells."""
        return np.ascontiguousarray(self._columns.T)

    def nearest(self, queries: Points) -> tuple[NDArray[np.int32], Points]:
        """Find the nearest point within reach of each query (N, 3).

        Returns
        -------
        (N,) row of `points`, or -1, and (N,) squared distance, or infinity.
        """
        row, squared = nearest_within(queries, self.reach, self.arrays)
        return row, squared

    def nearest_rows(self, queries: Points) -> NDArray[np.int64]:
        """Return the (N,) rows of the given cloud nearest to queries (N, 3), -1 beyond reach."""
        ordered, order, _ = bucket_order(queries, self._grid)
        nearest = np.empty(len(queries), np.int64)
        restore_order(self.nearest(ordered)[0], self.rows, order, nearest)
        return nearest

    def planes(self, queries: Points) -> LocalPlanes:
        """Fit a plane to the points within reach of each query (N, 3)."""
        return LocalPlanes(*local_planes(queries, self.reach, self.arrays))
