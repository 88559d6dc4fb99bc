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
    masses: NDArray[np.float32]
    """(M,) of its points; empty where all are 1."""
    starts: NDArray[np.int64]
    """(leaves + 1,) leaf l holds the points starts[l]:starts[l + 1]."""
    cells: NDArray[np.float32]
    """(2 leaves - 1, 11) centre of mass, mass, second moments about it (xx xy xz yy yz zz), and the
    radius of the ball around it that holds the points."""


def tree_order(points: Array) -> NDArray[np.intp]:
    """(N,) rows of the points (N, 3) such that neighbours stand together."""
    order: NDArray[np.intp] = KDTree(points, leafsize=GROUP).indices
    return order


def build_tree(points: Array, masses: Array | None = None) -> Tree:
    """Halve the cloud (M, 3) of masses (M,), or 1 each, until a cell holds at most GROUP points."""
    order = tree_order(points)
    points, kept = points[order], np.empty(0) if masses is None else masses[order]
    masses = np.ones(len(points)) if masses is None else kept
    starts = np.array([0, len(points)])
    cells = [_cells(points, masses, starts)]
    while np.diff(starts).max() > GROUP:
        middles = (starts[:-1] + starts[1:]) // 2  # where KDTree halves, too
        starts = np.insert(starts, np.arange(1, len(starts)), middles)
        cells.append(_cells(points, masses, starts))
    rows = np.ascontiguousarray(points.T, np.float32)
    all_cells = np.concatenate(cells, dtype=np.float32)
    return Tree(rows, kept.astype(np.float32), starts, all_cells)


def _cells(points: Array, masses: Array, starts: NDArray[np.int64]) -> Array:
    """(cells, 11) of one level, rows as in `Tree.cells`."""
    first, count = starts[:-1], np.diff(starts)
    mass = np.add.reduceat(masses, first)
    centre = np.add.reduceat(masses[:, None] * points, first) / mass[:, None]
    x, y, z = (points - np.repeat(centre, count, axis=0)).T
    products = np.stack([x * x, x * y, x * z, y * y, y * z, z * z], axis=1)
    moments = np.add.reduceat(masses[:, None] * products, first)
    squared = np.maximum.reduceat(x * x + y * y + z * z, first)
    radius = np.maximum(np.sqrt(squared), LEAST_RADIUS)
    return np.column_stack([centre, mass, moments, radius])
