"""A small feature decides between poses that fit alike: one of them leaves no point unexplained.

Turned about its axis a shaft lies on itself but for its key. The evidence is a mean over all
points, which a feature of a hundredth of them hardly moves. Where the clouds show the same whole,
though, a right pose explains every point of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpe_core.assess.confidence import Evidence
from mpe_core.geometry.cell_list import CellList, Points
from mpe_core.geometry.rigid import apply, axis_rotation, inverse, pose
from mpe_core.geometry.sampling import take_every
from mpe_core.refine.regime import Regime

Array = NDArray[np.float64]

EXPLAINED_TOL, EXPLAINED_TOL_SPACINGS, EXPLAINED_TOL_NOISES = 0.008, 2.5, 3.0
"""Distance within which a point of the other cloud explains a point, in radii of the smaller cloud,
in point spacings and in roughnesses, whichever is largest: of random points on a surface one in
3e8 has its nearest beyond 2.5 spacings."""

MAX_LEFT, MIN_LEFT = 0.001, 0.004
"""Share of the points that the pose that explains all may leave, and that each other has to leave:
a key of 2.4 % of a shaft leaves 0.01 (docs/tuning.md)."""

MIN_ON_SURFACE = 0.9
"""On-surface fraction from which on a pose may explain all points."""

SUBSET_POINTS = 10_000
"""Points of each cloud that are asked for, or up to twice as many."""


class Completeness:
    """What poses leave unexplained of both clouds."""

    def __init__(self, source: Points, target: Points, regime: Regime) -> None:
        """Choose the tolerance.

        Parameters
        ----------
        source, target
            (N, 3) and (M, 3) fine points.
        regime
            Noise and density of the pair.
        """
        self._clouds = source, target
        self._reach = max(
            EXPLAINED_TOL,
            EXPLAINED_TOL_SPACINGS * regime.spacing,
            EXPLAINED_TOL_NOISES * regime.roughness,
        )

    @cached_property
    def _cells(self) -> tuple[CellList, CellList]:
        source, target = self._clouds
        return CellList(source, self._reach), CellList(target, self._reach)

    @cached_property
    def _subsets(self) -> tuple[Points, Points]:
        source, target = self._clouds
        return take_every(source, SUBSET_POINTS), take_every(target, SUBSET_POINTS)

    def share_left(self, T: Array) -> float:
        """Share of the points of the cloud of which the pose T (4, 4) explains less."""
        moves = T, inverse(T)
        found = (
            cells.nearest(apply(move, points).astype(np.float32))[0]
            for cells, move, points in zip(self._cells[::-1], moves, self._subsets, strict=True)
        )
        return max(float((rows < 0).mean()) for rows in found)

    def find_only(self, poses: Sequence[Array], evidence: Sequence[Evidence]) -> int | None:
        """Row of the one of different poses (4, 4) that explains all; None if it is not one."""
        may_explain = [each.on_surface_fraction >= MIN_ON_SURFACE for each in evidence]
        least = 2 if any(each.convinces for each in evidence) else 1
        if sum(may_explain) < least or len(poses) < 2:
            return None  # no pose is near it, and the best convinces; or none may explain all
        left = np.array(
            [self.share_left(T) if may else 1.0 for T, may in zip(poses, may_explain, strict=True)]
        )
        best = int(np.argmin(left))
        others = np.delete(left, best)
        if left[best] > MAX_LEFT or others.min() < MIN_LEFT:
            return None
        return None if sum(may_explain) < 2 and self._has_twin(poses[best]) else best

    def _has_twin(self, T: Array) -> bool:
        """Whether a quarter or half turn about an axis of the source explains as much as T."""
        points = self._subsets[0].astype(np.float64)
        centre = points.mean(axis=0)
        _, axes = np.linalg.eigh(np.cov((points - centre).T))
        turns = (axis_rotation(axis, k * np.pi / 2) for axis in axes.T for k in (1, 2, 3))
        return any(
            self.share_left(T @ pose(R, centre - np.einsum("ij,j->i", R, centre))) < MIN_LEFT
            for R in turns
        )
