"""What scanners saw in each direction: range images of a cloud from its viewpoints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.viewpoints import nearest_viewpoint

Array = NDArray[np.float64]

ROWS, COLUMNS = 90, 180
"""Cells of elevation and azimuth, 2 degrees each: several points of a thinned scan fall into one
at the distances where most points lie (docs/tuning.md)."""

CELLS = ROWS * COLUMNS


class RangeImage:
    """Ranges of a cloud in the cells of a sphere around each of its viewpoints.

    Each viewpoint tells of the part of space that is nearest to it, whichever scanner measured the
    points there. Such a part holds all of the way to each of its points, and so all that can hide
    them. What lies beyond it was hardly measured from there, and tells nothing of the way.
    """

    def __init__(self, points: NDArray[np.floating], viewpoints: Array) -> None:
        """Take the ranges of the points (N, 3), each seen from the nearest viewpoint (k, 3)."""
        self._viewpoints = viewpoints
        cells, ranges = self._project(points)
        self.median_range = float(np.median(ranges))
        """Distance of half of the points from their viewpoints."""
        nearest = np.full(len(viewpoints) * CELLS, np.inf)
        np.minimum.at(nearest, cells, ranges)
        self._is_seen = np.isfinite(nearest)
        for image in nearest.reshape(-1, ROWS, COLUMNS):
            image[:] = _minimum_of_neighbours(image)
        self._range = nearest

    def look_up(self, points: NDArray[np.floating]) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Compare points (N, 3) with what was seen in their directions.

        Returns
        -------
        ranges
            (N,) distances of the points from the viewpoints nearest to them.
        seen
            (N,) smallest range in the cell of each point and its eight neighbours; infinity where
            nothing was seen.
        is_seen
            (N,) whether something was seen in the cell itself.
        """
        cells, ranges = self._project(points)
        return ranges, self._range[cells], self._is_seen[cells]

    def _project(self, points: NDArray[np.floating]) -> tuple[NDArray[np.int64], Array]:
        """(N,) cells of the points (N, 3), and their distances from the nearest viewpoints."""
        viewpoint = nearest_viewpoint(points, self._viewpoints)
        offset = points.astype(np.float64) - self._viewpoints[viewpoint]
        ranges = np.sqrt(np.einsum("ni,ni->n", offset, offset))
        safe = np.maximum(ranges, np.finfo(np.float64).tiny)
        elevation = np.arcsin(np.clip(offset[:, 2] / safe, -1, 1)) / np.pi + 0.5
        azimuth = np.arctan2(offset[:, 1], offset[:, 0]) / (2 * np.pi) + 0.5
        row = np.minimum((elevation * ROWS).astype(np.int64), ROWS - 1)
        column = (azimuth * COLUMNS).astype(np.int64) % COLUMNS
        return viewpoint * CELLS + row * COLUMNS + column, ranges


def _minimum_of_neighbours(image: Array) -> Array:
    """Minimum over 3 x 3 cells; the azimuth closes, the elevation ends."""
    rows = np.pad(image, ((1, 1), (0, 0)), constant_values=np.inf)
    lowest = np.minimum(np.minimum(rows[:-2], rows[1:-1]), rows[2:])
    smallest: Array = np.minimum(
        np.minimum(np.roll(lowest, 1, axis=1), lowest), np.roll(lowest, -1, axis=1)
    )
    return smallest
