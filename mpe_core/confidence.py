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

SHARP_WEIGHT, NEAR_WEIGHT, OFFSET = 17.1, 3.5, -13.8
"""Logistic model of right against wrong, a wrong one counting three times, fitted to every other
one of the 85 shared pairs (three starts each) and of 120 impossible ones (half 0 of `python -m
benchmarks confidence`): of those it refused one pair (dragon 72-0, all starts) and accepted one of
60 impossible ones (0.56); of the other halves it refused none of 126 and accepted none of 60. Area
under the ROC curve of all: 0.9998.
Without the correction for chance, two to three of each 60 impossible ones were accepted."""

MOST_CHANCE = 0.9
"""So that one is left to tell; the shared pairs have 0.11 to 0.38."""

ACCEPTED = 0.5
"""Confidence from which on a pose is accepted."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for a pose."""

    near: float
    """Share of the points within the reach of the target's planes."""
    sharp: float
    """Share of those that lie on the planes and face as they do, beyond the share that chance puts
    there: 0 for points that lie anywhere, 1 for all."""
    overlap: float = 1.0
    """Share of the points that may be near, as the caller knows it."""

    @property
    def confidence(self) -> float:
        """How likely the pose is right, in [0, 1]."""
        near = min(1.0, self.near / self.overlap)
        logit = SHARP_WEIGHT * self.sharp + NEAR_WEIGHT * near + OFFSET
        return float(1 / (1 + np.exp(-logit)))

    @property
    def accepted(self) -> bool:
        """Whether the pose is taken for right."""
        return self.confidence >= ACCEPTED


def evidence(
    source: Sample, planes: TargetPlanes, T: NDArray[np.float64], sharp: float, overlap: float
) -> Evidence:
    """Evidence for the pose T; `sharp` is how near a plane is on it."""
    pairs = nearest_planes(source, planes, T)
    known = np.abs(pairs.normals).sum(axis=1) > 0
    near = pairs.within & known
    if not near.any():
        return Evidence(0.0, 0.0, overlap)
    on = np.abs(pairs.residuals()[near]) < sharp
    on &= pairs.used[near]
    chance = min(sharp / float(planes.cells.reach), MOST_CHANCE)
    beyond = max(0.0, (float(on.mean()) - chance) / (1 - chance))
    return Evidence(near.sum() / len(near), beyond, overlap)


def sharp_distance(spacing: float, roughness: float) -> float:
    """How near a plane counts as on it, for clouds of this point spacing and roughness."""
    return max(LEAST_SHARP, SHARP_SPACINGS * spacing, SHARP_NOISES * roughness)
