"""How far to trust a pose: whether the points that are near the target lie on its surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.polish import TargetPlanes, nearest_planes
from mpe_core.scan import Sample

LEAST_SHARP, SHARP_SPACINGS, SHARP_NOISES = 0.006, 0.3, 1.5
"""Distance from a plane that counts as on it: in radii of the smaller cloud, in point spacings and
in roughnesses, whichever is most."""

OVER_SPACINGS = 0.3
"""How far along the plane the nearest point may lie, in point spacings of the coarser surface:
where it is farther off, the target has a hole or ends, and its plane says nothing. Pairs that
overlap little lie beyond an end with most of their near points: of 295 right poses of shared pairs
and pairs composed from them, a model of all near points refuses 17, with 1.5 / 0.7 / 0.5 / 0.3
spacings 7 / 4 / 4 / 4, and of 245 wrong ones it accepts 2, 2 / 1 / 1 / 0."""

SHARP_WEIGHT, ON_WEIGHT, OFFSET = 33.1, 7.9, -32.8
"""Logistic model of right against wrong, a wrong one counting three times, fitted to half 0: every
other one of the 85 shared pairs (two starts each) and of 244 impossible ones, of each the pose with
the most confidence. Of half 1 it accepts none of 122 impossible ones and refuses one of 84 right
ones (0.41); of both it accepts one (0.61). Area under the ROC curve of half 1: 0.9999.
Without the correction for chance, two to three of each 60 impossible ones were accepted."""

MOST_CHANCE = 0.9
"""So that one is left to tell; the shared pairs have 0.11 to 0.38."""

ACCEPTED = 0.5
"""Confidence from which on a pose is accepted."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for a pose."""

    on: float
    """Share of the points that lie on the target's planes and face as they do."""
    sharp: float
    """Share of those over a point of the target that lie on its plane and face as it does, beyond
    the share that chance puts there: 0 for points that lie anywhere, 1 for all."""
    overlap: float = 1.0
    """Share of the points that may lie on the target, as the caller knows it."""

    @property
    def confidence(self) -> float:
        """How likely the pose is right, in [0, 1]."""
        on = min(1.0, self.on / self.overlap)
        logit = SHARP_WEIGHT * self.sharp + ON_WEIGHT * on + OFFSET
        return float(1 / (1 + np.exp(-logit)))

    @property
    def accepted(self) -> bool:
        """Whether the pose is taken for right."""
        return self.confidence >= ACCEPTED

    @property
    def rank(self) -> tuple[bool, float]:
        """Which of several poses of a pair is best, the greatest: sharpness alone, which the
        confidence rests on, does not see that more points lie on the target in another one."""
        return self.accepted, self.on * self.sharp


def evidence(
    source: Sample,
    planes: TargetPlanes,
    T: NDArray[np.float64],
    sharp: float,
    spacing: float,
    overlap: float,
) -> Evidence:
    """Evidence for the pose T; `sharp` is how near a plane is on it, `spacing` that of the points
    of the coarser surface."""
    pairs = nearest_planes(source, planes, T)
    near = pairs.within & (np.abs(pairs.normals).sum(axis=1) > 0)
    residual = np.abs(pairs.residuals())
    across = np.square(pairs.points - pairs.moved).sum(axis=1) - np.square(residual)
    over = near & (across < (OVER_SPACINGS * spacing) ** 2)
    on = near & (residual < sharp) & pairs.used
    if not over.any():
        return Evidence(float(on.mean()), 0.0, overlap)
    chance = min(sharp / float(planes.cells.reach), MOST_CHANCE)
    beyond = max(0.0, (float(on[over].mean()) - chance) / (1 - chance))
    return Evidence(float(on.mean()), beyond, overlap)


def sharp_distance(spacing: float, roughness: float) -> float:
    """How near a plane counts as on it, for clouds of this point spacing and roughness."""
    return max(LEAST_SHARP, SHARP_SPACINGS * spacing, SHARP_NOISES * roughness)
