"""How far a cloud reaches, and where its middle lies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.kernels.bounds import centred, extents, products

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Extent:
    """Bounds and middle of a cloud."""

    low: Array
    """(3,) lowest coordinates."""
    high: Array
    """(3,) highest coordinates."""
    mean: Array
    """(3,) centre of mass; not finite if a point is not."""

    @property
    def largest(self) -> float:
        """Largest absolute coordinate."""
        return float(max(self.high.max(), -self.low.min()))

    @property
    def length(self) -> float:
        """Largest distance from the mean along an axis."""
        return float(max((self.high - self.mean).max(), (self.mean - self.low).max()))


def extent(points: Array | NDArray[np.float32]) -> Extent:
    """Of points (N, 3); not finite where there are none."""
    if not len(points):
        return Extent(*np.full((3, 3), np.nan))
    found = extents(points)
    with np.errstate(invalid="ignore", over="ignore"):
        mean = points[0] + found[:, 2].sum(axis=0) / len(points)
    return Extent(found[:, 0].min(axis=0), found[:, 1].max(axis=0), mean)


def scatter(points: Array, reached: Extent) -> Array:
    """(3, 3) sum of v v^T over the points' offsets v from the mean, in lengths of the extent."""
    total: Array = products(points, reached.mean, reached.length).sum(axis=0)
    return total


def offsets(points: Array, centre: Array, length: float) -> Array:
    """(N, 3) the points' offsets from the centre (3,), in lengths."""
    found = np.empty(points.shape)
    centred(points, centre, length, found)
    return found
