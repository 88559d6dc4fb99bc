"""A fixed cloud in nested halves: the cells that stand for its points from afar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from mpe_core.kernels.tree_sum import GROUP

Array = NDArray[np.float64]

LEAST_RADIUS = 1e-5
"""Of a cell: nearer than a few of these its Taylor series would overflow float32."""


@dataclass(frozen=True, slots=True)
class Tree:
    """Balanced binary tree of a cloud; cell k of the heap has the halves 2 k + 1 and 2 k + 2."""

    points: NDArray[np.float32]
    """(3, M) the cloud in the order of the leaves."""
    starts: NDArray[np.int64]
    """(leaves + 1,) leaf l holds the points starts[l]:starts[l + 1]."""
    cells: NDArray[np.float32]
    """(2 leaves - 1, 11) centroid, count, second moments about it (xx xy xz yy yz zz), radius."""


def tree_order(points: Array) -> NDArray[np.intp]:
    """(N,) rows of the points (N, 3) such that neighbours stand together."""
    order: NDArray[np.intp] = KDTree(points, leafsize=GROUP).indices
    return order


def build_tree(points: Array) -> Tree:
    """Halve the cloud (M, 3) until a cell holds at most GROUP points."""
    points = points[tree_order(points)]
    starts, cells = np.array([0, len(points)]), [_cells(points, np.array([0, len(points)]))]
    while np.diff(starts).max() > GROUP:
        middles = (starts[:-1] + starts[1:]) // 2  # where KDTree halves, too
        starts = np.insert(starts, np.arange(1, len(starts)), middles)
        cells.append(_cells(points, starts))
    return Tree(
        np.ascontiguousarray(points.T, np.float32), starts, np.concatenate(cells, dtype=np.float32)
    )


def _cells(points: Array, starts: NDArray[np.int64]) -> Array:
    """(cells, 11) of one level, rows as in `Tree.cells`."""
    first, count = starts[:-1], np.diff(starts)
    centroid = np.add.reduceat(points, first) / count[:, None]
    x, y, z = (points - np.repeat(centroid, count, axis=0)).T
    products = np.stack([x * x, x * y, x * z, y * y, y * z, z * z], axis=1)
    moments = np.add.reduceat(products, first)
    squared = np.maximum.reduceat(x * x + y * y + z * z, first)
    radius = np.maximum(np.sqrt(squared), LEAST_RADIUS)
    return np.column_stack([centroid, count, moments, radius])
