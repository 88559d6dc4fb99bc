"""Bounds, center and scatter of a cloud."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.kernels.bounds import center_and_scale, task_extents, task_scatter

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Extent:
    """Bounds and mean of a cloud."""

    low: Array
    """(3,) lowest coordinates."""
    high: Array
    """(3,) highest coordinates."""
    mean: Array
    """(3,) mean of the points; not finite if a point is not."""

    @property
    def max_coordinate(self) -> float:
        """Largest absolute coordinate."""
        return float(max(self.high.max(), -self.low.min()))

    @property
    def max_offset(self) -> float:
        """Largest distance from the mean along an axis."""
        return float(max((self.high - self.mean).max(), (self.mean - self.low).max()))


def measure_extent(points: Array) -> Extent:
    """Return the extent of points (N, 3); all of it is NaN where there are none."""
    if not len(points):
        return Extent(*np.full((3, 3), np.nan))
    parts = task_extents(points)
    with np.errstate(invalid="ignore", over="ignore"):
        mean = points[0] + parts[:, 2].sum(axis=0) / len(points)
    return Extent(parts[:, 0].min(axis=0), parts[:, 1].max(axis=0), mean)


def scatter_matrix(points: Array, extent: Extent) -> Array:
    """Return the (3, 3) sum of v v^T, v = (point - extent.mean) / extent.max_offset."""
    total: Array = task_scatter(points, extent.mean, extent.max_offset).sum(axis=0)
    return total


def centered(points: Array, center: Array, length: float) -> Array:
    """Return (points - center) / length as a new array (N, 3)."""
    out = np.empty(points.shape)
    center_and_scale(points, center, length, out)
    return out
