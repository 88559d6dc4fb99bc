"""Two clouds of one levelled scene, each seen from above the ground that both show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.ground import find_ground, may_have_ground
from mpe_core.clouds.preprocess import PreparedCloud
from mpe_core.geometry.cell_list import Points
from mpe_core.search.levelled_cloud import LevelledCloud, has_ceiling

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


def level_clouds(source: PreparedCloud, target: PreparedCloud) -> LevelledPair | None:
    """Look at both clouds from above; None unless both show a ground."""
    surfaces = source.surface, target.surface
    if not all(may_have_ground(surface.points, surface.normals) for surface in surfaces):
        return None
    x, y = (_within_reach(surface.points) for surface in surfaces)
    ground_x = find_ground(x)
    if ground_x.share < MIN_GROUND_SHARE:
        return None
    ground_y = find_ground(y)
    if ground_y.share < MIN_GROUND_SHARE:
        return None
    roofed = has_ceiling(x, ground_x) or has_ceiling(y, ground_y)
    grounds = [ground_x]
    if not (ground_x.is_extremal and ground_y.is_extremal):
        grounds.append(ground_x.flipped())
    if roofed:
        grounds.append(ground_x.opposite(x))
    return LevelledPair(
        tuple(
            LevelledCloud.from_points(x, ground, source.viewpoints, has_ceiling=roofed)
            for ground in grounds
        ),
        LevelledCloud.from_points(y, ground_y, target.viewpoints, has_ceiling=roofed),
    )


def _within_reach(points: Points) -> Points:
    """Points (N, 3) at most MAX_REACH from the centre."""
    near: NDArray[np.float32] = points[np.square(points).sum(axis=1) <= MAX_REACH**2]
    return near
