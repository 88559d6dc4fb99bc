"""Point-to-plane refinement on the full clouds."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.preprocess import PreparedCloud, Sample
from mpe_core.geometry.cell_list import CellList, LocalPlanes, Points
from mpe_core.geometry.sampling import take_every
from mpe_core.options import RegistrationOptions
from mpe_core.refine import covariance
from mpe_core.refine.covariance import DERIVATIVE_POINTS, MotionAxes, PoseUncertainty
from mpe_core.refine.gauss_newton import minimize_point_to_plane
from mpe_core.refine.minimum import Minimum
from mpe_core.refine.regime import Regime
from mpe_core.refine.small_features import is_held
from mpe_core.refine.target_planes import Correspondences, TargetPlanes, match_planes

Array = NDArray[np.float64]

MAX_STEPS = 20
"""Bound on the steps of a candidate's refinement. Only the best goes on (docs/tuning.md)."""

MAX_SMOOTHED_RATIO = 0.9
"""Residual of the smoothed clouds over that of the raw ones up to which the smoothed ones are
refined: smoothing then evens out noise rather than shape (docs/tuning.md)."""

SUBSET_POINTS = 1000
"""Points of the sample that preselection, the choice of smoothing and the degeneracy test use."""

FEATURE_POINTS = 20_000
"""Points, or up to twice as many, in which small features are looked for where surfaces slide."""

SHARP_WIDTH, SHARP_POINTS = 0.6, 8000
"""Width of the planes on which the best pose is laid in the end over that of all others, and points
of the moving cloud, spread evenly over its surface, that are laid on them (docs/tuning.md)."""

PRESELECT_STEPS = 10
"""Bound on the steps of the refinement that preselects candidates."""


class PointToPlane:
    """Refiner that lays a sample of one cloud, `moving`, on local planes of another, `fixed`."""

    def __init__(
        self,
        moving: PreparedCloud,
        fixed: PreparedCloud,
        motion_basis: Array,
        regime: Regime,
        options: RegistrationOptions,
    ) -> None:
        """Draw the sample; planes are fitted when they are needed.

        Parameters
        ----------
        moving, fixed
            Prepared clouds; poses map the moving one onto the fixed one.
        motion_basis
            (6, K) basis of the small motions that are allowed.
        regime
            Noise and density of the pair.
        options
            Options of the registration; `seed` and `max_iterations` are used.
        """
        self._moving, self._fixed, self._motion_basis = moving, fixed, motion_basis
        self._sample = moving.sample(options.seed)
        self._planes = TargetPlanes(
            fixed.fine, fixed.surface.spacing, regime.plane_noise, fixed.viewpoints
        )
        # the few planes of sparse clouds would smooth shape, too
        self._may_smooth = not regime.is_sparse
        # and narrower ones would hold too few points, or not average the noise
        self._may_sharpen = not (regime.is_sparse or regime.is_noisy)
        self._max_iterations = options.max_iterations
        self._last: tuple[Array, Correspondences] | None = None

    @property
    def radius(self) -> float:
        """Radius of the planes, and reach of the matching."""
        return self._planes.radius

    def point_spacing(self) -> float:
        """Distance between neighbouring points of the fixed cloud."""
        return self._planes.point_spacing()

    def refine(self, T: Array) -> Minimum:
        """Come near the minimum next to the pose T, of the smoothed clouds if these fit better."""
        return self.refine_all(T[None])[0]

    def refine_all(self, poses: Array) -> list[Minimum]:
        """Come near the minimum next to each of the poses (K, 4, 4), as `refine` does."""
        return self._refine(poses, min(MAX_STEPS, self._max_iterations))

    def settle(self, minimum: Minimum) -> Minimum:
        """Go on to the minimum from where a refinement ran out of steps."""
        left = self._max_iterations - minimum.iterations
        if left <= 0:
            return minimum
        (settled,) = self._refine(minimum.T[None], left)
        return replace(settled, iterations=minimum.iterations + settled.iterations)

    def sharpen(self, minimum: Minimum) -> Minimum:
        """Go on from a minimum on narrower planes; one of noisy or sparse clouds stays what it is.

        A scanner measures most points near itself: there the sample has many, and far walls, which
        hold a pose, few. Here the points lie evenly.
        """
        left = self._max_iterations - minimum.iterations
        if not self._may_sharpen or minimum.criterion != "point_to_plane" or left <= 0:
            return minimum
        sample = Sample(self._moving.coarse_points(SHARP_POINTS), None)
        planes = TargetPlanes(self._fixed.fine, self._fixed.surface.spacing, width=SHARP_WIDTH)
        (found,) = minimize_point_to_plane(
            sample, planes, minimum.T[None], self._motion_basis, left, is_near=True
        )
        return replace(found, iterations=minimum.iterations + found.iterations)

    def match(self, T: Array) -> Correspondences:
        """Match the sample at the pose T with the planes; the last answer is kept."""
        if self._last is None or not np.array_equal(self._last[0], T):
            self._last = T.copy(), match_planes(self._sample, self._planes, T)
        return self._last[1]

    @cached_property
    def variation(self) -> Points:
        """(N,) surface variation of the moving cloud around the points of the sample."""
        return self._planes_of_sample.comparable_variation(self.radius)

    @cached_property
    def variation_of_subset(self) -> Points:
        """(n,) surface variation around the points that `match_subset` takes."""
        return self._planes_of_subset.comparable_variation(self.radius)

    @cached_property
    def variation_of_fixed(self) -> Points:
        """(M,) surface variation at some points of the fixed cloud."""
        return self._planes.variation_of_subset()

    def refine_shortly(self, poses: Array) -> Array:
        """(K, 4, 4) poses that a subset of the sample reaches in a few steps from others."""
        minima = self._minimize(self._subset, poses, PRESELECT_STEPS)
        return np.array([minimum.T for minimum in minima])

    def match_subset(self, T: Array) -> Correspondences:
        """Match a subset of the sample at the pose T with the planes."""
        return match_planes(self._subset, self._planes, T)

    def count_degenerate(self, T: Array) -> int:
        """Count the directions in which the surfaces slide on themselves at the pose T."""
        return covariance.count_degenerate(self._information(T))

    def uncertainty(self, minimum: Minimum) -> PoseUncertainty:
        """Estimate the error of the minimum, as a motion about the origin of the fixed cloud."""
        smooth, T = minimum.criterion == "smoothed_point_to_plane", minimum.T
        sliding = MotionAxes.of(self._information(T), self._motion_basis)
        is_held = self._are_held(T, sliding)
        sample = self._smoothed_sample if smooth else self._sample
        return covariance.point_to_plane_uncertainty(
            sample,
            self._planes,
            T,
            match_planes(sample, self._planes, T, smooth=True) if smooth else self.match(T),
            sliding.with_held(is_held),
            smooth=smooth,
            derivative_points=len(self._sample.points) if is_held.any() else DERIVATIVE_POINTS,
        )

    def _are_held(self, T: Array, sliding: MotionAxes) -> NDArray[np.bool_]:
        """(K,) whether small features resist the free motions at the pose T."""
        sample = Sample(take_every(self._moving.fine, FEATURE_POINTS), None)
        return np.array(
            [is_held(sample, self._planes, T, axis, sliding.known) for axis in sliding.free.T],
            np.bool_,
        )

    def _refine(self, poses: Array, max_steps: int) -> list[Minimum]:
        minima = self._minimize(self._sample, poses, max_steps)
        if not self._may_smooth:
            return minima
        rows = [row for row, each in enumerate(minima) if self._fits_better_smoothed(each.T)]
        if rows:
            starts = np.array([minima[row].T for row in rows])
            found = self._minimize(self._smoothed_sample, starts, max_steps, smooth=True)
            for row, minimum in zip(rows, found, strict=True):
                minima[row] = minimum
        return minima

    def _minimize(
        self, sample: Sample, poses: Array, max_steps: int, *, smooth: bool = False
    ) -> list[Minimum]:
        return minimize_point_to_plane(
            sample, self._planes, poses, self._motion_basis, max_steps, smooth=smooth
        )

    def _fits_better_smoothed(self, T: Array) -> bool:
        raw = self.match_subset(T)
        smoothed = match_planes(self._smoothed_subset, self._planes, T, smooth=True)
        cutoff = self._planes.cutoff
        return smoothed.weighted_rms(cutoff) < MAX_SMOOTHED_RATIO * raw.weighted_rms(cutoff)

    @cached_property
    def _subset(self) -> Sample:
        return self._sample.subset(SUBSET_POINTS)

    @cached_property
    def _smoothed_sample(self) -> Sample:
        return _projected(self._sample, self._planes_of_sample)

    @cached_property
    def _smoothed_subset(self) -> Sample:
        return _projected(self._subset, self._planes_of_subset)

    @cached_property
    def _planes_of_sample(self) -> LocalPlanes:
        """Planes through the neighbours of the sample in the moving cloud."""
        return self._moving_cells.planes(self._sample.points)

    @cached_property
    def _planes_of_subset(self) -> LocalPlanes:
        return self._moving_cells.planes(self._subset.points)

    @cached_property
    def _moving_cells(self) -> CellList:
        return CellList(self._moving.fine, self.radius)

    def _information(self, T: Array) -> Array:
        normals = self._planes_of_subset.normals
        return covariance.surface_information(
            self._subset, normals, self._planes, T, self._motion_basis
        )


def _projected(sample: Sample, planes: LocalPlanes) -> Sample:
    """Project the sample on the planes at its points."""
    return Sample(planes.project(sample.points), sample.normals)
