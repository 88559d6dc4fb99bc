"""Points in cubes: thinning, nearest points within reach, planes through neighbourhoods."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpe_core.extent import extent
from mpe_core.kernels.cells import (
    LAST_CELL,
    cell_means,
    keys_of_cells,
    nearest_within,
    number_cells,
    sort_by_cell,
)
from mpe_core.kernels.local_planes import local_planes
from mpe_core.kernels.rows import columns_at, rows_by_cell

Points = NDArray[np.float32]


def grid(points: Points, size: float) -> tuple[Points, np.float32]:
    """Origin (3,) and cell size of a grid over the points (N, 3): the size asked for, or the
    smallest that numbers every cell."""
    reached = extent(points)
    edge = max(size, float((reached.high - reached.low).max()) / (LAST_CELL - 2))
    return reached.low.astype(np.float32), np.float32(edge)


def thin(points: Points, size: float) -> Points:
    """(K, 3) means of the points (N, 3) in each occupied cube of edge `size`, in order of
    appearance."""
    means: Points = cell_means(points, *grid(points, size))[0]
    return means


def thin_weighted(
    points: Points, weights: NDArray[np.float64], size: float
) -> tuple[Points, Points]:
    """(K, 3) weighted means of the points (N, 3) in each occupied cube of edge `size`, and the mean
    weight (K,) of each."""
    _, _, cell, counts = number_cells(points, *grid(points, size))
    total = np.bincount(cell, weights)
    moments = [np.bincount(cell, weights * column) for column in points.T]
    means: Points = np.ascontiguousarray((moments / total).T, np.float32)
    return means, (total / counts).astype(np.float32)


def crowd(points: Points, size: float) -> float:
    """Mean number of the points (N, 3) in an occupied cube of edge `size`."""
    return len(points) / len(number_cells(points, *grid(points, size))[3])


def cube_order(points: Points, size: float) -> NDArray[np.int32]:
    """(N,) rows of the points (N, 3), cube by cube of edge `size`."""
    _, _, cell, counts = number_cells(points, *grid(points, size))
    rows: NDArray[np.int32] = rows_by_cell(cell, counts)
    return rows


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
    """A fixed cloud (M, 3) in cubes of edge `reach`, asked for what lies within that reach of any
    point."""

    def __init__(self, points: Points, reach: float) -> None:
        self._origin, self.reach = grid(points, reach)
        self._keys, self._slots, cell_of, counts = number_cells(points, self._origin, self.reach)
        order = np.argsort(keys_of_cells(self._keys, self._slots, len(counts)))
        self.starts, self.rows = sort_by_cell(self._keys, self._slots, cell_of, counts, order)
        """Where each cube's points start in `points`, and the row of the given cloud that each came
        from."""
        self._columns = columns_at(points, self.rows)

    @cached_property
    def points(self) -> Points:
        """(M, 3) the cloud in the order of its cubes."""
        return np.ascontiguousarray(self._columns.T)

    def nearest(
        self, queries: Points, within: float | None = None
    ) -> tuple[NDArray[np.int32], Points]:
        """(N,) rows of `points` nearest to queries (N, 3) and their squared distances; -1 and
        infinity where nothing is within reach, or a shorter distance."""
        most = self.reach if within is None else min(self.reach, np.float32(within))
        row, squared = nearest_within(queries, most, *self._grid())
        return row, squared

    def planes(self, queries: Points) -> LocalPlanes:
        """Plane through the points within reach of each query (N, 3)."""
        return LocalPlanes(*local_planes(queries, *self._grid()))

    def _grid(self) -> tuple[NDArray[np.generic] | np.float32, ...]:
        return (
            self._columns,
            self.starts,
            self._keys,
            self._slots,
            self._origin,
            self.reach,
        )
