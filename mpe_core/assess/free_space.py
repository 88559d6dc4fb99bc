"""Free space: a pose is wrong that lays points of one scan into what the other saw through."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.range_image import RangeImage
from mpe_core.geometry.rigid import apply, inverse
from mpe_core.geometry.sampling import take_every

Array = NDArray[np.float64]

RANGE_MARGIN = 0.08
"""Share of the range by which a point has to stand in front of a surface to stand in free space,
or behind it to be hidden (docs/tuning.md)."""

MAX_MARGIN = 0.05
"""Largest such distance, in radii of the smaller cloud: of things far off, a share of the range is
as much as they are thick (docs/tuning.md)."""

MIN_COMPARED = 25
"""Points that have to be comparable with a range image; fewer tell nothing."""

MAX_RANGE = 4.0
"""Median range, in radii of the smaller cloud, up to which the cells of a range image are small
beside what is seen; from farther away the nearest point in them hides the depth of all others."""

MAX_POINTS = 4000
"""Points of each cloud that are compared with the range image of the other one."""


class FreeSpace:
    """Range images of both clouds of a pair, from their viewpoints.

    Lengths are in radii of the smaller cloud.
    """

    def __init__(
        self,
        source: NDArray[np.float32],
        target: NDArray[np.float32],
        source_viewpoints: Array,
        target_viewpoints: Array,
    ) -> None:
        """Build the range images of both clouds, each in its own frame.

        Parameters
        ----------
        source, target
            (N, 3) and (M, 3) points.
        source_viewpoints, target_viewpoints
            (k, 3) and (l, 3) places of the scanners.
        """
        self._source_image = RangeImage(source, source_viewpoints)
        self._target_image = RangeImage(target, target_viewpoints)
        images = self._source_image, self._target_image
        self.tells_depths = max(image.median_range for image in images) <= MAX_RANGE
        """Whether both scanners stood near enough to tell what stands in front of what."""
        self._source = take_every(source, MAX_POINTS)
        self._target = take_every(target, MAX_POINTS)

    def violation(self, T: Array) -> float:
        """Share of the visible points of one scan that stand in the free space of the other.

        Points that the other scan did not look at, or that are hidden from it, do not count. The
        larger of both directions, in [0, 1]; near 0 for a right pose.

        Parameters
        ----------
        T
            (4, 4) T_target_source.
        """
        return max(
            _violation(self._target_image, apply(T, self._source)),
            _violation(self._source_image, apply(inverse(T), self._target)),
        )


def _violation(image: RangeImage, points: Array) -> float:
    in_front, visible = compare_with(image, points)
    compared = max(int(visible.sum()), MIN_COMPARED)
    return float(in_front.sum() / compared)


def compare_with(image: RangeImage, points: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell which points (N, 3) stand in what scanners saw through, and which are not hidden.

    Parameters
    ----------
    image
        What the scanners saw.
    points
        Points of the other cloud, in the frame of the image.

    Returns
    -------
    in_front, visible
        (N,) clearly in front of what was seen in their direction; not behind it.
    """
    ranges, seen, is_seen = image.look_up(points)
    seen = np.where(is_seen, seen, 0)
    margin = np.minimum(RANGE_MARGIN * seen, MAX_MARGIN)
    return is_seen & (ranges < seen - margin), is_seen & (ranges < seen + margin)
