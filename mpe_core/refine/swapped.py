"""Adapter that exchanges source and target of the point-to-plane refinement."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.cell_list import Points
from mpe_core.geometry.rigid import inverse
from mpe_core.refine.covariance import PoseUncertainty
from mpe_core.refine.minimum import Minimum
from mpe_core.refine.point_to_plane import PointToPlane
from mpe_core.refine.target_planes import Correspondences

Array = NDArray[np.float64]


class SwappedPointToPlane:
    """Point-to-plane of the target on planes of the source, for poses of the source on the target.

    The only place where source and target are exchanged.
    """

    def __init__(self, inner: PointToPlane) -> None:
        """Wrap a refiner of which the target is the moving cloud."""
        self._inner = inner
        self.radius = inner.radius

    @property
    def variation(self) -> Points:
        """(N,) surface variation of the target around the points of its sample."""
        return self._inner.variation

    @property
    def variation_of_subset(self) -> Points:
        """(n,) surface variation around the points that `match_subset` takes."""
        return self._inner.variation_of_subset

    @property
    def variation_of_fixed(self) -> Points:
        """(M,) surface variation at some points of the source."""
        return self._inner.variation_of_fixed

    def point_spacing(self) -> float:
        """Distance between neighbouring points of the source."""
        return self._inner.point_spacing()

    def refine(self, T: Array) -> Minimum:
        """Find the minimum next to the pose T."""
        return self._inner.refine(inverse(T)).inverse()

    def refine_all(self, poses: Array) -> list[Minimum]:
        """Find the minimum next to each of the poses (K, 4, 4)."""
        minima = self._inner.refine_all(np.array([inverse(T) for T in poses]))
        return [minimum.inverse() for minimum in minima]

    def settle(self, minimum: Minimum) -> Minimum:
        """Go on to the minimum from where a refinement ran out of steps."""
        return self._inner.settle(minimum.inverse()).inverse()

    def sharpen(self, minimum: Minimum) -> Minimum:
        """Make a minimum more exact where the clouds are clean and dense."""
        start = minimum.inverse()
        found = self._inner.sharpen(start)
        return minimum if found is start else found.inverse()

    def match(self, T: Array) -> Correspondences:
        """Match a sample of the target with the planes of the source, at the pose T."""
        return self._inner.match(inverse(T))

    def refine_shortly(self, poses: Array) -> Array:
        """(K, 4, 4) poses that a subset of the sample reaches in a few steps from others."""
        ends = self._inner.refine_shortly(np.array([inverse(T) for T in poses]))
        return np.array([inverse(T) for T in ends])

    def match_subset(self, T: Array) -> Correspondences:
        """Match a subset of the sample with the planes of the source, at the pose T."""
        return self._inner.match_subset(inverse(T))

    def count_degenerate(self, T: Array) -> int:
        """Count the directions in which the surfaces slide on themselves at the pose T."""
        return self._inner.count_degenerate(inverse(T))

    def uncertainty(self, minimum: Minimum) -> PoseUncertainty:
        """Estimate the error of the minimum, as a motion about the target's origin."""
        return self._inner.uncertainty(minimum.inverse()).of_inverse(minimum.T)


PlaneRefiner = PointToPlane | SwappedPointToPlane
