"""Nearest points of a mesh of triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.kernels.triangle_tree import LEAF_TRIANGLES, nearest_in_mesh

_GRID_BITS = 21
"""Bits of a coordinate of the grid that orders the triangles; three of them fit into 64 bits."""
_SPREAD = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)
"""Shifts and masks that move the bits of a number apart, two places between each."""


class TriangleTree:
    """Boxes around the triangles (F, 3, 3) of a mesh; there is at least one.

    Neighbouring triangles share a box: they are ordered along a curve through a grid (Morton
    1966).
    """

    def __init__(self, triangles: NDArray[np.float64]) -> None:
        self._order = np.argsort(_morton_codes(triangles.mean(axis=1)), kind="stable")
        ordered = triangles[self._order]
        self._triangles = np.ascontiguousarray(ordered.reshape(-1, 9))
        self._boxes = _build_boxes(ordered)

    def nearest(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Find the nearest point of the mesh to each of points (N, 3), which are finite.

        Returns
        -------
        (N, 3) points, (N,) rows of their triangles, and (N,) where they lie in these: 0 inside, 1
        to 3 on the edge from corner 0, 1, 2 to the next, 4 to 6 at corner 0, 1, 2.
        """
        queries = np.ascontiguousarray(points, np.float64)
        nearest, rows, places = nearest_in_mesh(queries, self._triangles, self._boxes)
        return nearest, self._order[rows], places


def _morton_codes(points: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Return the place of each point along a curve through a grid around all."""
    low = points.min(axis=0)
    edge = max(float((points.max(axis=0) - low).max()), 1e-300) / (2**_GRID_BITS - 1)
    cells = ((points - low) / edge).astype(np.uint64)
    for shift, mask in _SPREAD:
        cells = (cells | cells << np.uint64(shift)) & np.uint64(mask)
    codes: NDArray[np.uint64] = cells @ np.array([1, 2, 4], np.uint64)
    return codes


def _build_boxes(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the boxes (2 L, 6), from the root, 1, to the leaves, L to 2 L - 1."""
    starts = np.arange(0, len(triangles), LEAF_TRIANGLES)
    leaves = 1 << int(len(starts) - 1).bit_length()
    boxes = np.empty((2 * leaves, 6))
    boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
    filled = boxes[leaves : leaves + len(starts)]
    filled[:, :3] = np.minimum.reduceat(triangles.min(axis=1), starts)
    filled[:, 3:] = np.maximum.reduceat(triangles.max(axis=1), starts)
    while leaves > 1:
        below = boxes[leaves : 2 * leaves].reshape(-1, 2, 6)
        leaves //= 2
        boxes[leaves : 2 * leaves, :3] = below[:, :, :3].min(axis=1)
        boxes[leaves : 2 * leaves, 3:] = below[:, :, 3:].max(axis=1)
    return boxes
