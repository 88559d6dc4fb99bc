"""How far to trust a pose: whether the points that are near the target lie on its surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.preprocess import Sample
from mpe_core.options import ACCEPTANCE_THRESHOLD
from mpe_core.refine.point_to_plane import TargetPlanes, nearest_planes

LEAST_SHARP, SHARP_SPACINGS, SHARP_NOISES = 0.006, 0.3, 1.5
"""Distance from a plane that counts as on it: in radii of the smaller cloud, in point spacings and
in roughnesses, whichever is most."""

OVER_SPACINGS = 0.5
"""How far along the plane the nearest point may lie, in point spacings of the coarser surface:
where it is farther off, the target has a hole or ends, and its plane says nothing. Pairs that
overlap little lie beyond an end with most of their near points: of 145 right poses composed from
the shared pairs (overlap 0.2 and more) a model of all near points refuses 34, with 1 / 0.7 / 0.5 /
0.3 spacings 8 / 6 / 4 / 4."""

CALM = 0.18
"""Share that chance puts on a plane up to which only what lies over a point counts; beyond it noise
decides which points do, also of wrong poses. Below it are 91 % of the shared pairs, 99 % of those
composed from them, and 1 % of all with noise of 0.006 to 0.02 radii. Area under the ROC curve of
half 1 with that noise 0.986, as with all near points, and 0.965 if only what lies over counts."""

SHARP_WEIGHT, NEAR_WEIGHT, OFFSET = 18.6, 6.6, -18.7
"""Logistic model of right against wrong, a wrong one counting twice, fitted to half 0 of the shared
and of 240 impossible pairs, as they are and with noise of 0.006 to 0.02 radii (`python -m
benchmarks calibration`). Of the half that it was not fitted to, it refuses one of 42 right poses
and accepts none of 120 wrong ones; with noise 13 of 201 and 8 of 120. A wrong one counting once
accepts 13 of these, three times 7, and refuses 8 and 17 right ones. Chance, spacing or the number
of points as a third term change none of these by more than two. A model of all near points, fitted
without noise, accepted 13 of 91 with noise; one without the correction for chance two to three of
each 60 without."""

LIKE_SIZES = 2.0
"""Radius of the larger cloud over that of the smaller one up to which the model is as it was
fitted; the shared pairs have up to 1.65, the impossible ones 2.4. Beyond it each place where the
smaller one fits by chance counts against the pose: their number goes with the square, and once more
with the ratio for each direction in which the surfaces slide on themselves. Seven pairs with the
target scaled by 5 / 8 / 16 / 25.4 / 50, three seeds: without this the surest wrong pose has a
confidence of 0.02 / 0.08 / 0.11 / 0.53 / 0.36. Parts of the shared clouds on the whole
(`python -m benchmarks parts`): with the square alone 40 of 565 are accepted in a wrong place and 65
of 444 right poses refused, with the free directions 17 and 76 of 450."""

MOST_CHANCE = 0.9
"""So that one is left to tell; the shared pairs have 0.11 to 0.38."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for a pose."""

    near: float
    """Share of the points within the reach of the target's planes."""
    on: float
    """Share of the points that lie on these planes and face as they do."""
    sharp: float
    """Share of those over a point of the target that lie on its plane and face as it does, beyond
    the share that chance puts there: 0 for points that lie anywhere, 1 for all."""
    overlap: float = 1.0
    """Share of the points that may be near, as the caller knows it."""
    larger: float = 1.0
    """Radius of the larger cloud over that of the smaller one."""
    free: int = 0
    """Directions in which the surfaces slide on themselves; asked for beyond LIKE_SIZES alone."""

    @property
    def confidence(self) -> float:
        """How likely the pose is right, in [0, 1]."""
        near = min(1.0, self.near / self.overlap)
        logit = SHARP_WEIGHT * self.sharp + NEAR_WEIGHT * near + OFFSET
        places = max(1.0, self.larger / LIKE_SIZES) ** (2 + self.free)
        return float(1 / (1 + places * np.exp(-logit)))

    @property
    def accepted(self) -> bool:
        """Whether the pose is taken for right."""
        return self.confidence >= ACCEPTANCE_THRESHOLD

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
    larger: float,
) -> Evidence:
    """Evidence for the pose T; `sharp` is how near a plane is on it, `spacing` that of the points
    of the coarser surface, `overlap` and `larger` as in Evidence."""
    pairs = nearest_planes(source, planes, T)
    near = pairs.within & (np.abs(pairs.normals).sum(axis=1) > 0)
    residual = np.abs(pairs.residuals())
    chance = min(sharp / float(planes.cells.reach), MOST_CHANCE)
    telling = near
    if chance < CALM:
        across = np.square(pairs.points - pairs.moved).sum(axis=1) - np.square(residual)
        telling = near & (across < (OVER_SPACINGS * spacing) ** 2)
    on = near & (residual < sharp) & pairs.used
    share = float(on[telling].mean()) if telling.any() else 0.0
    beyond = max(0.0, (share - chance) / (1 - chance))
    return Evidence(float(near.mean()), float(on.mean()), beyond, overlap, larger)


def sharp_distance(spacing: float, roughness: float) -> float:
    """How near a plane counts as on it, for clouds of this point spacing and roughness."""
    return max(LEAST_SHARP, SHARP_SPACINGS * spacing, SHARP_NOISES * roughness)
