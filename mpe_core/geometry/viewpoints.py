"""Places of the scanners that measured a cloud: one, or several of a cloud that was merged."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

Array = NDArray[np.float64]


def as_viewpoints(places: ArrayLike) -> Array:
    """Return one place (3,) or several (k, 3) as distinct places (k, 3), always in one order."""
    return np.unique(np.atleast_2d(np.asarray(places, np.float64)), axis=0)


def nearest_viewpoint(points: NDArray[np.floating], viewpoints: Array) -> NDArray[np.intp]:
    """(N,) rows of the viewpoints (k, 3) that lie nearest to the points (N, 3)."""
    if len(viewpoints) == 1:
        return np.zeros(len(points), np.intp)
    _, rows = KDTree(viewpoints).query(points)
    return np.asarray(rows, np.intp)
