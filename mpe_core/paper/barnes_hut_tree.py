"""A fixed cloud in a balanced binary tree whose cells stand for their points from afar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from mpe_core.kernels.tree_sum import GROUP

Array = NDArray[np.float64]

MIN_CELL_RADIUS = 1e-5
"""Least radius of a cell, in radii of the cloud: at a distance of a few smaller ones the Taylor
series would overflow float32."""


@dataclass(frozen=True, slots=True)
class Tree:
    """Balanced binary tree of a cloud; cell k has the children 2 k + 1 and 2 k + 2."""

    points: NDArray[np.float32]
    """(3, M) the cloud in the order of the leaves."""
    weights: NDArray[np.float32]
    """(M,) weights of the points; empty where all are 1."""
    starts: NDArray[np.int64]
    """(leaves + 1,) leaf l holds the points starts[l]:starts[l + 1]."""
    cells: NDArray[np.float32]
    """(2 leaves - 1, 11) center of mass, weight, second moments about the center (xx xy xz yy yz
    zz), and radius of the ball around it that holds the points."""


def tree_order(points: Array) -> NDArray[np.intp]:
    """Return the (N,) rows of points (N, 3) in an order in which neighbors follow each other."""
    order: NDArray[np.intp] = KDTree(points, leafsize=GROUP).indices
    return order


def build_tree(points: Array, weights: Array | None = None) -> Tree:
    """Halve a cloud until no cell holds more than GROUP points.

    Parameters
    ----------
    points
        (M, 3) cloud.
    weights
        (M,) weights; 1 each where none are given.
    """
    order = tree_order(points)
    points, stored = points[order], np.empty(0) if weights is None else weights[order]
    ordered_weights = np.ones(len(points)) if weights is None else stored
    starts = np.array([0, len(points)])
    cells = [_cells(points, ordered_weights, starts)]
    while np.diff(starts).max() > GROUP:
        middles = (starts[:-1] + starts[1:]) // 2  # where KDTree halves, too
        starts = np.insert(starts, np.arange(1, len(starts)), middles)
        cells.append(_cells(points, ordered_weights, starts))
    columns = np.ascontiguousarray(points.T, np.float32)
    all_cells = np.concatenate(cells, dtype=np.float32)
    return Tree(columns, stored.astype(np.float32), starts, all_cells)


def _cells(points: Array, weights: Array, starts: NDArray[np.int64]) -> Array:
    """Return the (cells, 11) of one level, columns as in `Tree.cells`."""
    first, count = starts[:-1], np.diff(starts)
    weight = np.add.reduceat(weights, first)
    center = np.add.reduceat(weights[:, None] * points, first) / weight[:, None]
    x, y, z = (points - np.repeat(center, count, axis=0)).T
    products = np.stack([x * x, x * y, x * z, y * y, y * z, z * z], axis=1)
    moments = np.add.reduceat(weights[:, None] * products, first)
    squared = np.maximum.reduceat(x * x + y * y + z * z, first)
    radius = np.maximum(np.sqrt(squared), MIN_CELL_RADIUS)
    return np.column_stack([center, weight, moments, radius])
