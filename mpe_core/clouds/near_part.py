"""Long narrow scans, of corridors and tunnels: only the part around the scanner is registered.

Their length sets the unit of length, in which they are too narrow to show a surface.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.surface import MAX_VARIATION, MIN_NEIGHBOURS, MIN_RADIUS, SUBSET_POINTS
from mpe_core.clouds.validate import Cloud
from mpe_core.geometry.cell_list import CellList, voxel_downsample
from mpe_core.geometry.sampling import take_every
from mpe_core.geometry.viewpoints import as_viewpoints, nearest_viewpoint
from mpe_core.options import Viewpoints

Array = NDArray[np.float64]

SHARES = (0.7, 0.5, 0.35, 0.25, 0.18)
"""Radii of the part that is kept, over that of the cloud: the largest that shows a surface."""

FINE_SHARE = 0.25
"""Radius of smaller neighbourhoods over the usual one. Those of a narrow scan show a surface that
the usual ones do not; those of noise show even less (docs/tuning.md)."""

VOXELS_PER_RADIUS = 5
"""Thinning of the neighbourhoods that are looked at."""

MIN_KEPT = 2000
"""Points that have to be left."""


def find_near_radius(cloud: Cloud, radius: float, centre: Array) -> float | None:
    """Find the distance from the scanner up to which a long narrow cloud shows a surface.

    Parameters
    ----------
    cloud
        A checked cloud.
    radius
        Radius of the cloud.
    centre
        (3,) position of the scanner, see `scanner_place`.

    Returns
    -------
    float or None
        In the unit of the cloud; None if the cloud is not too narrow, or has weights.
    """
    if cloud.weights is not None or not _shows_surface(
        cloud.points - centre, FINE_SHARE * MIN_RADIUS * radius
    ):
        return None
    tried = (share * radius for share in SHARES)
    return next((reach for reach in tried if shows_surface_within(cloud, reach, centre)), None)


def scanner_place(cloud: Cloud, viewpoints: Viewpoints | None) -> Array:
    """(3,) place of the scanner in the middle; the median of the points if none is known."""
    middle: Array = np.median(cloud.points, axis=0)
    if viewpoints is None:
        return middle
    places = as_viewpoints(viewpoints)
    (row,) = nearest_viewpoint(middle[None], places)
    nearest: Array = places[row]
    return nearest


def shows_surface_within(cloud: Cloud, reach: float, centre: Array) -> bool:
    """Whether enough points lie within reach of the scanner, and show a surface in its unit."""
    near = cloud.points[_is_within(cloud, reach, centre)] - centre
    return len(near) >= MIN_KEPT and _shows_surface(near, MIN_RADIUS * reach)


def keep_near_part(cloud: Cloud, reach: float, centre: Array) -> Cloud:
    """Give the points beyond reach of the scanner a weight of 0."""
    return replace(cloud, weights=_is_within(cloud, reach, centre).astype(np.float64))


def _is_within(cloud: Cloud, reach: float, centre: Array) -> NDArray[np.bool_]:
    offsets = cloud.points - centre
    within: NDArray[np.bool_] = np.einsum("ni,ni->n", offsets, offsets) <= reach**2
    return within


def _shows_surface(points: Array, radius: float) -> bool:
    """Whether neighbourhoods of a radius hold enough points, and vary little at the median."""
    thinned = voxel_downsample(points.astype(np.float32), radius / VOXELS_PER_RADIUS)
    planes = CellList(thinned, radius).planes(take_every(thinned, SUBSET_POINTS))
    has_neighbours = np.median(planes.counts) >= MIN_NEIGHBOURS
    return bool(has_neighbours and np.median(planes.surface_variation) <= MAX_VARIATION)
