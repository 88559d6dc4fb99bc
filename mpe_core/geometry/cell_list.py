"""Points in cubes: thinning, nearest points within reach, planes through neighbourhoods."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.bounds import extent
from mpe_core.kernels.buckets import partitioned
from mpe_core.kernels.cell_list import LAST_CELL, nearest_within
from mpe_core.kernels.cell_table import (
    FEW_CELLS,
    MANY_CELLS,
    cells_of_buckets,
    means_of_buckets,
    number_cells,
    table_of,
)
from mpe_core.kernels.local_planes import local_planes
from mpe_core.kernels.point_rows import columns_at, rows_as_given

Points = NDArray[np.float32]

EDGE = 2.0
"""Edge of the cubes over the reach. Planes through the 69 points within reach of each of 8,251:
2.03 ms with 1, 1.76 / 1.48 / 1.28 / 1.25 with 1.2 / 1.5 / 2 / 2.5, because more points come in
fewer runs; their nearest points 0.18 ms with 1 to 1.5, 0.19 / 0.22 with 2 / 2.5."""

LARGE = 200_000
"""Points from which on they are laid bucket by bucket. Nearest points of 40,000 / 100,000 / 200,000
/ 500,000: 4.1 / 8.8 / 16 / 46 ms in buckets, 2.9 / 8.1 / 17 / 58 as they come."""


def grid(points: Points, size: float) -> tuple[Points, np.float32]:
    """Origin (3,) and cell size of a grid over the points (N, 3): the size asked for, or the
    smallest that numbers every cell."""
    reached = extent(points)
    edge = max(size, float((reached.high - reached.low).max()) / (LAST_CELL - 2))
    return reached.low.astype(np.float32), np.float32(edge)


def bucket_order(
    points: Points, origin: Points, size: np.float32
) -> tuple[Points, NDArray[np.int32], NDArray[np.int64]]:
    """Points (N, 3), the row that each came from, and bounds of the buckets in which no cube of the
    grid is cut: many are laid bucket by bucket, so that what is used together stays in the
    processor's cache."""
    if len(points) >= LARGE:
        ordered, rows = np.empty_like(points), np.empty(len(points), np.int32)
        bounds = partitioned(points, origin, size, ordered, rows)
        return ordered, rows, bounds
    return points, np.arange(len(points), dtype=np.int32), np.array([0, len(points)])


def voxel_downsample(points: Points, size: float) -> Points:
    """(K, 3) means of the points (N, 3) in each occupied cube of edge `size`."""
    cubes = grid(points, size)
    ordered, _, bounds = bucket_order(points, *cubes)
    means: Points = means_of_buckets(ordered, bounds, *cubes)
    return means


def voxel_downsample_weighted(
    points: Points, weights: NDArray[np.float64], size: float
) -> tuple[Points, Points]:
    """(K, 3) weighted means of the points (N, 3) in each occupied cube of edge `size`, and the mean
    weight (K,) of each."""
    _, _, cell, counts = number_cells(points, *grid(points, size), MANY_CELLS)
    total = np.bincount(cell, weights)
    moments = [np.bincount(cell, weights * column) for column in points.T]
    means: Points = np.ascontiguousarray((moments / total).T, np.float32)
    return means, (total / counts).astype(np.float32)


def count_occupied(points: Points, size: float) -> int:
    """How many cubes of edge `size` hold any of the points (N, 3)."""
    return len(number_cells(points, *grid(points, size), FEW_CELLS)[3])


@dataclass(frozen=True, slots=True)
class LocalPlanes:
    """Planes around queries; fewer than 5 points give a zero normal and an offset of 0."""

    normals: Points
    """(N, 3) unit normals of either sign."""
    variation: Points
    """(N,) smallest eigenvalue of the points' covariance over its trace."""
    thickness: Points
    """(N,) standard deviation of the points from the plane."""
    counts: NDArray[np.int32]
    """(N,) how many points lie around."""
    offsets: Points
    """(N,) distance of the plane from the query along the normal."""

    def feet(self, queries: Points) -> Points:
        """(N, 3) the queries laid on their planes."""
        laid: Points = queries + self.offsets[:, None] * self.normals
        return laid


class CellList:
    """A fixed cloud (M, 3) in cubes, asked for what lies within a reach of any point."""

    def __init__(self, points: Points, reach: float, edge: float | None = None) -> None:
        """The edge of the cubes is at least the reach, EDGE times that if it is not given. Both
        grow for a cloud too wide for cubes of that reach."""
        self._origin, self.reach = grid(points, reach)
        self._edge = max(self.reach, np.float32(EDGE * reach if edge is None else edge))
        ordered, rows, bounds = bucket_order(points, self._origin, self._edge)
        cells, self.starts, order = cells_of_buckets(ordered, bounds, self._origin, self._edge)
        self._keys, self._slots = table_of(cells)
        self.rows = rows[order]
        """Where each cube's points start in `points`, and the row of the given cloud that each came
        from."""
        self._columns = np.empty((3, len(points)), np.float32)
        columns_at(ordered, order, self._columns)

    @cached_property
    def points(self) -> Points:
        """(M, 3) the cloud in the order of its cubes."""
        return np.ascontiguousarray(self._columns.T)

    def nearest(self, queries: Points) -> tuple[NDArray[np.int32], Points]:
        """(N,) rows of `points` nearest to queries (N, 3) and their squared distances; -1 and
        infinity where nothing is within reach."""
        row, squared = nearest_within(queries, self.reach, *self._grid())
        return row, squared

    def nearest_given(self, queries: Points) -> NDArray[np.int64]:
        """(N,) rows of the given cloud nearest to queries (N, 3); -1 where nothing is within
        reach."""
        ordered, order, _ = bucket_order(queries, self._origin, self._edge)
        found = np.empty(len(queries), np.int64)
        rows_as_given(self.nearest(ordered)[0], self.rows, order, found)
        return found

    def planes(self, queries: Points) -> LocalPlanes:
        """Plane through the points within reach of each query (N, 3)."""
        return LocalPlanes(*local_planes(queries, self.reach, *self._grid()))

    def _grid(self) -> tuple[NDArray[np.generic] | np.float32, ...]:
        return (
            self._columns,
            self.starts,
            self._keys,
            self._slots,
            self._origin,
            self._edge,
        )
