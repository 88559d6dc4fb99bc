"""Refinement by the potential of all pairs, for noise beyond the point spacing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.preprocess import PreparedCloud
from mpe_core.clouds.surface import Surface
from mpe_core.geometry.cell_list import CellList, Points
from mpe_core.geometry.rigid import apply, cross_matrix, inverse
from mpe_core.geometry.sampling import take_every
from mpe_core.kernels.potential_moments import potential_moments
from mpe_core.kernels.rigid_motion import update_pose
from mpe_core.refine.covariance import MotionAxes, PoseUncertainty, sandwich_covariance
from mpe_core.refine.minimum import STEP_TOL, Minimum
from mpe_core.refine.refiner import Refiner
from mpe_core.refine.regime import FULL_SUM_POINTS

Array = NDArray[np.float64]

SOFTENING_NOISES = 3.0
"""eps of the potential over the noise. The error of the pose is flat around it and grows with a
smaller eps where there is much noise (docs/tuning.md)."""

MIN_NOISE = 0.01
"""Smallest noise that is assumed, in radii of the smaller cloud."""

NORMAL_LOWER_QUARTILE = 0.3186
"""Lower quartile of |z| for a standard normal z."""

MIN_ON_SURFACE_GAIN = 0.02
"""Share of the points by which point-to-plane must lay more on the surface than the full sum, to be
preferred: what looks like noise are outliers then (docs/tuning.md)."""


class FullSum:
    """Refiner that minimises the potential of all pairs, or falls back on planes."""

    def __init__(
        self,
        source: PreparedCloud,
        target: PreparedCloud,
        motion_basis: Array,
        max_iterations: int,
        planes: Refiner,
        on_surface_fraction: Callable[[Array], float],
    ) -> None:
        """Take up to FULL_SUM_POINTS points of each cloud.

        Parameters
        ----------
        source, target
            Prepared clouds.
        motion_basis
            (6, K) basis of the small motions that are allowed.
        max_iterations
            Bound on the steps.
        planes
            Refiner to fall back on.
        on_surface_fraction
            Share of the points that lie on the target's surface at a pose: what decides.
        """
        self._surfaces = source.surface, target.surface
        self._points = source.coarse_points(FULL_SUM_POINTS), target.coarse_points(FULL_SUM_POINTS)
        self._motion_basis, self._max_iterations = motion_basis, max_iterations
        self._planes, self._on_surface_fraction = planes, on_surface_fraction

    def refine(self, T: Array) -> Minimum:
        """Find the minimum next to the pose T, and the better of it and that of the planes."""
        minimum = Minimum(T, False, 0)
        for _ in range(2):  # the noise is known once the pose is
            minimum = minimize_full_sum(
                *self._points,
                minimum.T,
                self._softening(minimum.T),
                self._motion_basis,
                self._max_iterations,
            )
        # outliers look like noise, too; but planes lay the other points on the surface
        planar = self._planes.refine(minimum.T)
        gain = self._on_surface_fraction(planar.T) - self._on_surface_fraction(minimum.T)
        return planar if gain > MIN_ON_SURFACE_GAIN else minimum

    def refine_all(self, poses: Array) -> list[Minimum]:
        """Find the minimum next to each of the poses (K, 4, 4)."""
        return [self.refine(T) for T in poses]

    def settle(self, minimum: Minimum) -> Minimum:
        """Go on to the minimum from where a refinement by planes ran out of steps."""
        return minimum if minimum.criterion == "full_sum" else self._planes.settle(minimum)

    def sharpen(self, minimum: Minimum) -> Minimum:
        """Leave the minimum as it is: there is noise."""
        return minimum

    def uncertainty(self, minimum: Minimum) -> PoseUncertainty:
        """Estimate the error of the minimum, as a motion about the target's origin."""
        if minimum.criterion != "full_sum":
            return self._planes.uncertainty(minimum)
        return full_sum_uncertainty(
            *self._points, minimum.T, self._softening(minimum.T), self._motion_basis
        )

    def _softening(self, T: Array) -> float:
        return SOFTENING_NOISES * estimate_noise(*self._surfaces, T)


def estimate_noise(source: Surface, target: Surface, T: Array) -> float:
    """Estimate the standard deviation of the distances between two surfaces at the pose T.

    It is told from the lower quartile of the distances from the planes of the smoother surface, so
    that up to three quarters of the points may be outliers.
    """
    if source.roughness < target.roughness:
        smooth, moved = source, apply(inverse(T), target.points[target.weights > 0])
    else:
        smooth, moved = target, apply(T, source.points[source.weights > 0])
    cells = CellList(smooth.points, 0.3)
    queries = take_every(moved, 2000).astype(np.float32)
    row, _ = cells.nearest(queries)
    near = row >= 0
    normals = smooth.normals[cells.rows[row[near]]]
    residual = np.abs(np.einsum("ni,ni->n", cells.points[row[near]] - queries[near], normals))
    if not near.any():
        return MIN_NOISE
    return max(float(np.quantile(residual, 0.25)) / NORMAL_LOWER_QUARTILE, MIN_NOISE)


def minimize_full_sum(
    source: Points, target: Points, T: Array, eps: float, motion_basis: Array, max_iterations: int
) -> Minimum:
    """Minimise -sum_ij 1 / (|y_j - (R x_i + t)|^2 + eps^2) over all pairs, from the pose T.

    Newton's method with Levenberg's damping, so that no step raises the energy by more than
    rounding; steps stay within the motion basis (6, K).
    """
    y = np.ascontiguousarray(target.T)
    here = PotentialExpansion(source, y, T, eps)
    damping, iterations, converged = 1e-3, 0, False
    while iterations < max_iterations and damping < 1e4 and not converged:
        iterations += 1
        step = here.step(damping, motion_basis)
        there = PotentialExpansion(source, y, here.moved(step), eps) if step is not None else here
        if step is None or there.energy > here.energy * (1 - 1e-7):
            damping = max(8 * damping, 1e-3)
            continue
        converged = bool(np.abs(step).max() < STEP_TOL)
        here, damping = there, 0.2 * damping
    return Minimum(here.T, converged, iterations, "full_sum")


def full_sum_uncertainty(
    source: Points, target: Points, T: Array, eps: float, motion_basis: Array
) -> PoseUncertainty:
    """Estimate the uncertainty of a minimum of `minimize_full_sum`.

    The sandwich H^-1 B H^-1, B the scatter of the pull over the source's points (N, 3).
    """
    here = PotentialExpansion(source, np.ascontiguousarray(target.T), T, eps)
    # turns and moves in units that move the points equally stiffly
    unit = 1 / np.sqrt(np.where(here.scale > 0, here.scale, 1))
    H = here.hessian * np.outer(unit, unit)
    B = np.einsum("ni,nj->ij", here.pulls, here.pulls) * np.outer(unit, unit)
    scaled = sandwich_covariance(
        H, B, MotionAxes.of(motion_basis.T @ H @ motion_basis, motion_basis)
    )
    return scaled.transformed_by(np.diag(unit)).with_origin(-here.centre)


class PotentialExpansion:
    """Energy, gradient and Hessian of the potential at a pose.

    The derivatives are over a rotation vector about the moved source's centroid, and a translation.
    """

    def __init__(self, source: Points, y: Points, T: Array, eps: float) -> None:
        """Sum over all pairs of the source (N, 3) at the pose T and the target y (3, M)."""
        self.T = T
        moved = apply(T, source)
        self.centre = moved.mean(axis=0)
        moments = np.empty((len(source), 11), np.float32)
        potential_moments(
            np.ascontiguousarray(moved.T.astype(np.float32)), y, np.float32(eps), moments
        )
        m = moments.astype(np.float64)
        arm = moved - self.centre
        self.energy = -m[:, 0].sum()
        pull = 2 * m[:, 2:5]
        self.pulls = np.concatenate([np.cross(arm, pull), pull], axis=1)
        self.gradient = self.pulls.sum(axis=0)
        self.hessian = self._hessian(m, arm, pull)
        inertia = (arm**2).sum() / len(arm) * 2 / 3
        self.scale = 2 * m[:, 1].sum() * np.array([inertia] * 3 + [1.0] * 3)

    @staticmethod
    def _hessian(m: Array, arm: Array, pull: Array) -> Array:
        """(6, 6) Hessian: curvature of the points through their arms, plus the turn of the arms."""
        xx, xy, xz, yy, yz, zz = m[:, 5:].T
        own = -8 * np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        own[[0, 1, 2], [0, 1, 2]] += 2 * m[:, 1]
        # columns of d p / d (w, v): -[arm]x and the identity
        J = np.zeros((3, 6, len(arm)))
        J[:, :3] = np.moveaxis(cross_matrix(-arm), 0, -1)
        J[[0, 1, 2], [3, 4, 5]] = 1
        H = np.einsum("ian,ijn,jbn->ab", J, own, J, optimize=["einsum_path", (0, 1), (0, 1)])
        turn = np.einsum("ni,nj->ij", pull, arm)
        H[:3, :3] -= (turn + turn.T) / 2 - np.trace(turn) * np.eye(3)
        hessian: Array = H
        return hessian

    def step(self, damping: float, motion_basis: Array) -> Array | None:
        """(6,) damped Newton step; None where the damped Hessian is not positive definite."""
        H = motion_basis.T @ (self.hessian + damping * np.diag(self.scale)) @ motion_basis
        try:
            np.linalg.cholesky(H)
        except np.linalg.LinAlgError:
            return None
        step: Array = motion_basis @ np.linalg.solve(H, motion_basis.T @ self.gradient)
        return step

    def moved(self, step: Array) -> Array:
        """(4, 4) pose after a step."""
        T = self.T.copy()
        T[:3, 3] -= self.centre
        update_pose(T, step)
        T[:3, 3] += self.centre
        return T
