"""Clouds of uneven density: most points in one small place do not set centre and unit of length."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mpe_core.geometry.distances import distances_from
from mpe_core.geometry.sampling import take_every

Array = NDArray[np.float64]

MIN_RATIO = 3.0
"""Distance of the farthest point over the radius from which on the points beyond are looked at."""

SPOT_SHARE, SPOT_SIZE = 0.9, 0.1
"""Share of the points, and the distance within which they lie over that of the farthest, that make
a dense spot: the radius may then be anything, and is not compared with."""

MIN_OUTER_POINTS, OUTER_SUBSET = 100, 600
"""Points beyond the radius that can show a surface, and how many of them are looked at."""

NEIGHBOURS, MAX_VARIATION = 10, 0.105
"""Neighbours of such a point, and their median surface variation up to which they show a surface:
stray points in a volume have 0.13."""

CELLS_PER_LENGTH = 64
"""Cells over the extent of the cloud; each counts once, however many points it holds."""

CELL_QUANTILE = 0.98
"""Share of the cells within the radius."""


def even_out(points: Array, centre: Array, radius: float) -> tuple[Array, float]:
    """Return centre (3,) and radius of the surface, where few places hold nearly all points.

    Parameters
    ----------
    points
        (N, 3) points.
    centre, radius
        Those by the number of points; returned as they are for all other clouds.
    """
    distance = distances_from(points, centre)
    in_spot = np.count_nonzero(distance < SPOT_SIZE * distance.max())
    has_spot = in_spot > SPOT_SHARE * len(points)
    if distance.max() <= MIN_RATIO * radius and not has_spot:
        return centre, radius
    spot = float(np.quantile(distance, SPOT_SHARE))
    outer = points[distance > (2 * spot if has_spot else 1.5 * radius)]
    if len(outer) < MIN_OUTER_POINTS or not _is_surface(outer):
        return centre, radius
    low, extent = points.min(axis=0), float(np.ptp(points, axis=0).max())
    cells = np.unique(np.floor((points - low) * (CELLS_PER_LENGTH / extent)), axis=0)
    places = (cells + 0.5) * (extent / CELLS_PER_LENGTH) + low
    middle = places.mean(axis=0)
    reach = float(np.quantile(distances_from(places, middle), CELL_QUANTILE))
    least = radius if spot < SPOT_SIZE * reach else MIN_RATIO * radius
    return (middle, reach) if reach > least else (centre, radius)


def _is_surface(points: Array) -> bool:
    subset = take_every(points, OUTER_SUBSET)
    _, rows = cKDTree(points).query(subset, NEIGHBOURS)
    near = points[np.asarray(rows)]
    near = near - near.mean(axis=1, keepdims=True)
    spread = np.linalg.eigvalsh(np.einsum("nki,nkj->nij", near, near))
    variation = spread[:, 0] / np.maximum(spread.sum(axis=1), np.finfo(float).tiny)
    return bool(np.median(variation) <= MAX_VARIATION)
