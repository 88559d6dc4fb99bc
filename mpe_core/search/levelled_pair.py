"""Two clouds of one levelled scene, each seen from above the ground that both show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.ground import find_ground
from mpe_core.clouds.preprocess import PreparedCloud
from mpe_core.geometry.cell_list import Points
from mpe_core.search.levelled_cloud import LevelledCloud, is_level

Array = NDArray[np.float64]

MAX_REACH = 10.0
"""Distance from the centre, in radii of the smaller cloud, up to which points are seen from above:
stray points beyond it would make the grids too wide for any memory."""

MIN_GROUND_SHARE = 0.15
"""Share of the points on the dominant plane from which on it is a ground. Figures and shelves have
less (docs/tuning.md)."""


@dataclass(frozen=True, slots=True)
class LevelledPair:
    """Source and target seen from above."""

    source: tuple[LevelledCloud, ...]
    """The source over each plane that may be the target's ground: the floor or the ceiling of a
    hall, either side of a plane that does not tell which is up."""
    target: LevelledCloud
    """The target over its ground."""

    def seen_from(self, source: Array | None, target: Array | None) -> LevelledPair:
        """Follow the rays from the places (k, 3) of the scanners, where these are known."""
        return LevelledPair(
            self.source if source is None else tuple(x.seen_from(source) for x in self.source),
            self.target if target is None else self.target.seen_from(target),
        )


def level_clouds(source: PreparedCloud, target: PreparedCloud) -> LevelledPair | None:
    """Look at both clouds from above; None unless both show a ground."""
    x, y = (_within_reach(cloud.surface.points) for cloud in (source, target))
    ground_x = find_ground(x)
    if ground_x.share < MIN_GROUND_SHARE:
        return None
    ground_y = find_ground(y)
    if ground_y.share < MIN_GROUND_SHARE:
        return None
    cloud_x, cloud_y = (
        LevelledCloud.from_points(points, ground)
        for points, ground in ((x, ground_x), (y, ground_y))
    )
    level_x, level_y = is_level(x, ground_x), is_level(y, ground_y)
    roofed = cloud_x.has_ceiling(level_x) or cloud_y.has_ceiling(level_y)
    grounds = []
    if not (ground_x.is_extremal and ground_y.is_extremal):
        grounds.append(ground_x.flipped())
    if roofed:
        grounds.append(ground_x.opposite(x))
    sources = [cloud_x, *(LevelledCloud.from_points(x, ground) for ground in grounds)]
    if roofed:
        sources, cloud_y = [each.over(level_x) for each in sources], cloud_y.over(level_y)
    return LevelledPair(tuple(sources), cloud_y).seen_from(source.viewpoints, target.viewpoints)


def _within_reach(points: Points) -> Points:
    """Points (N, 3) at most MAX_REACH from the centre."""
    near: NDArray[np.float32] = points[np.square(points).sum(axis=1) <= MAX_REACH**2]
    return near
