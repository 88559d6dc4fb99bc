"""A pair of clouds, centred and scaled to a common unit of length."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.uneven import even_out
from mpe_core.clouds.validate import Cloud
from mpe_core.geometry.bounds import centered
from mpe_core.geometry.distances import distances_from
from mpe_core.geometry.rigid import mirrored
from mpe_core.geometry.sampling import take_every
from mpe_core.geometry.viewpoints import as_viewpoints
from mpe_core.options import Viewpoints

Array = NDArray[np.float64]

MIN_RADIUS_RATIO = 1e-4
"""Radius of the smaller cloud over that of the larger one that is still resolved: in float32 the
larger cloud then keeps a thousandth of the smaller one's radius."""

RADIUS_QUANTILE = 0.98
"""Share of the points within the radius of a cloud: stray points do not set it."""

RADIUS_SUBSET_POINTS = 200_000
"""Points that the radius is taken from, or up to twice as many."""


@dataclass(frozen=True, slots=True)
class CloudPair:
    """Both clouds, each centred on its own centre of mass, in a common unit of length.

    The unit is the smaller of the two radii, so that neither stray points nor a large scene around
    a small part set it.
    """

    source_cloud: Cloud
    """Source as the caller passed it."""
    target_cloud: Cloud
    """Target as the caller passed it."""
    source: Array
    """(N, 3) points of the source, centred and scaled."""
    target: Array
    """(M, 3) points of the target, centred and scaled."""
    source_centre: Array
    """(3,) centre of mass of the source, in the caller's frame."""
    target_centre: Array
    """(3,) centre of mass of the target, in the caller's frame."""
    radii: tuple[float, float]
    """Radii of source and target, in the caller's unit."""
    unit: float
    """Length of 1 in the caller's unit."""
    is_uneven: bool = False
    """Whether few places hold nearly all points of a cloud, so that it is thinned more."""

    @property
    def size_ratio(self) -> float:
        """Radius of the larger cloud over the unit."""
        return max(self.radii) / self.unit

    def with_mirrored_source(self) -> CloudPair:
        """Return the pair with the source's x turned to -x."""
        return replace(
            self,
            source_cloud=self.source_cloud.mirrored(),
            source=mirrored(self.source),
            source_centre=self.source_centre * (-1, 1, 1),
        )

    def to_caller(self, T: Array) -> Array:
        """(4, 4) pose between the caller's clouds, for the pose T between the normalized ones."""
        pose = T.copy()
        pose[:3, 3] = self.unit * T[:3, 3] + self.target_centre - T[:3, :3] @ self.source_centre
        return pose

    def from_caller(self, T: Array) -> Array:
        """(4, 4) pose between the normalized clouds, for the pose T between the caller's."""
        pose = T.copy()
        moved = T[:3, :3] @ self.source_centre + T[:3, 3]
        pose[:3, 3] = (moved - self.target_centre) / self.unit
        return pose

    def viewpoints(
        self, source: Viewpoints | None, target: Viewpoints | None
    ) -> tuple[Array | None, Array | None]:
        """Places (k, 3) and (l, 3) of the scanners among the normalized clouds.

        From the caller's frames; None where they are not known.
        """
        return (
            None if source is None else (as_viewpoints(source) - self.source_centre) / self.unit,
            None if target is None else (as_viewpoints(target) - self.target_centre) / self.unit,
        )


def normalize_pair(source: Cloud, target: Cloud) -> CloudPair:
    """Centre both clouds on their centres of mass, and scale them by the smaller radius.

    Only points of a weight above 0 set centres and radii.
    """
    centres, radii, are_uneven = zip(*(_measure(each) for each in (source, target)), strict=True)
    small, large = sorted(radii)
    unit = max(small, MIN_RADIUS_RATIO * large)
    x, y = (
        centered(cloud.points, centre, unit)
        for cloud, centre in zip((source, target), centres, strict=True)
    )
    return CloudPair(source, target, x, y, centres[0], centres[1], radii, unit, any(are_uneven))


def _measure(cloud: Cloud) -> tuple[Array, float, bool]:
    """Centre (3,) and radius of a cloud, and whether its density is uneven."""
    points, centre = cloud.weighted(cloud.points), cloud.centroid()
    radius = robust_radius(points, centre)
    middle, reach = even_out(points, centre, radius)
    return middle, reach, reach > radius


def robust_radius(points: Array, centre: Array) -> float:
    """Compute the distance from the centre (3,) within which 98 % of the points (N, 3) lie.

    The largest distance if that is zero. Every k-th of many points is taken.
    """
    distance = distances_from(take_every(points, RADIUS_SUBSET_POINTS), centre)
    return float(np.quantile(distance, RADIUS_QUANTILE)) or float(distance.max())
