"""Covariance of a refined pose, and the directions in which it is not determined."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.preprocess import Sample
from mpe_core.geometry.cell_list import CellList, Points
from mpe_core.geometry.rigid import cross_matrix
from mpe_core.kernels.rigid_motion import update_pose
from mpe_core.refine.gauss_newton import gradients_at
from mpe_core.refine.target_planes import Correspondences, TargetPlanes, match_planes

Array = NDArray[np.float64]

DEGENERACY_THRESHOLD = 2e-3
"""Mean squared share of a unit motion along the normals under which a direction is degenerate,
unless a small feature holds it: between simple shapes and the worst of real scans
(docs/tuning.md)."""

MAX_DEVIATION, MAX_DEVIATION_RATIO = 0.03, 10.0
"""Standard deviation of a motion, in radians and radii of the smaller cloud, and over the median of
all, from which on the surfaces count as sliding on themselves: noise makes all motions unsure
(docs/tuning.md)."""

MIN_TURN_SHARE = 0.1
"""Singular value of the rotation vectors of unit motions from which on they turn."""

DERIVATIVE_STEP = 0.3
"""Step of the numerical derivative over the cut-off of the residuals. The points must change their
planes: with fixed planes, noisy clouds look too exact (docs/tuning.md)."""

DERIVATIVE_POINTS = 500
"""Points that the derivative is taken on."""


@dataclass(frozen=True, slots=True)
class PoseUncertainty:
    """Error of a pose T, as small motions exp(rotation vector, translation) T about an origin.

    Radians, and radii of the smaller cloud; along the axes of the target.
    """

    covariance: Array
    """(6, 6) covariance; of variance 1 along degenerate directions."""
    degenerate_directions: Array
    """(K, 6) motions that the surfaces do not resist."""

    @property
    def slides(self) -> int:
        """Number of translations among the degenerate directions: two or three on one plane."""
        turns = np.linalg.matrix_rank(self.degenerate_directions[:, :3], tol=MIN_TURN_SHARE)
        return len(self.degenerate_directions) - int(turns)

    def of_inverse(self, T_target_source: Array) -> PoseUncertainty:
        """Uncertainty of T_target_source, if this is that of its inverse."""
        R, t = T_target_source[:3, :3], T_target_source[:3, 3]
        adjoint = np.zeros((6, 6))
        adjoint[:3, :3] = adjoint[3:, 3:] = R
        adjoint[3:, :3] = cross_matrix(t) @ R
        return self.transformed_by(adjoint)

    def with_origin(self, origin: Array) -> PoseUncertainty:
        """Uncertainty as motions about another origin (3,)."""
        shift = np.eye(6)
        shift[3:, :3] = -cross_matrix(origin)
        return self.transformed_by(shift)

    def in_unit(self, unit: float) -> PoseUncertainty:
        """Uncertainty with translations in the caller's unit, `unit` of which are a radius."""
        return self.transformed_by(np.diag([1.0] * 3 + [unit] * 3))

    def transformed_by(self, change: Array) -> PoseUncertainty:
        """Uncertainty of the motions change @ m, change (6, 6)."""
        return PoseUncertainty(
            change @ self.covariance @ change.T, self.degenerate_directions @ change.T
        )


@dataclass(frozen=True, slots=True)
class MotionAxes:
    """Small motions, independent in what the surfaces tell of them; columns of (6, K)."""

    known: Array
    """Motions that the surfaces resist."""
    free: Array
    """Motions in which they slide on themselves."""

    @staticmethod
    def of(information: Array, motion_basis: Array) -> MotionAxes:
        """Split the motion basis (6, K) by the information (K, K) over it."""
        value, axes = np.linalg.eigh(information)
        is_free = value < DEGENERACY_THRESHOLD
        return MotionAxes(motion_basis @ axes[:, ~is_free], motion_basis @ axes[:, is_free])

    def with_held(self, is_held: NDArray[np.bool_]) -> MotionAxes:
        """Count free motions as known where `is_held` (K,)."""
        known = np.concatenate([self.known, self.free[:, is_held]], axis=1)
        return MotionAxes(known, self.free[:, ~is_held])


def point_to_plane_uncertainty(
    sample: Sample,
    planes: TargetPlanes,
    T: Array,
    matches: Correspondences,
    axes: MotionAxes,
    *,
    smooth: bool,
    derivative_points: int = DERIVATIVE_POINTS,
) -> PoseUncertainty:
    """Estimate the uncertainty of a minimum of `minimize_point_to_plane`, from its matches.

    The sandwich N^-1 B N^-1 of an M-estimator (Huber 1967): N is the derivative of the gradient, in
    which points change their planes, and B the scatter of the gradient over patches of the surface
    as wide as a plane (Liang and Zeger 1986), since points of one patch share the errors of their
    planes. Small features need more points of the derivative than the rest.
    """
    gradients = _gradients(matches, planes.cutoff)
    N = _stiffness(sample, planes, T, derivative_points, smooth=smooth)
    B = _scatter_over_patches(matches, gradients, planes.radius)
    return sandwich_covariance(N, B, axes)


def sandwich_covariance(N: Array, B: Array, axes: MotionAxes) -> PoseUncertainty:
    """Compute N^-1 B N^-1 in the directions that are known; those that vary too much are free."""
    known = axes.known
    half = np.linalg.inv(known.T @ N @ known)
    variance, own = np.linalg.eigh(half @ (known.T @ B @ known) @ half.T)
    usual = float(np.median(variance)) if len(variance) else 0.0
    is_free = variance > max(MAX_DEVIATION**2, MAX_DEVIATION_RATIO**2 * usual)
    free = np.concatenate([axes.free, known @ own[:, is_free]], axis=1)
    side = known @ own[:, ~is_free]
    covariance = free @ free.T + (side * variance[~is_free]) @ side.T
    return PoseUncertainty(covariance, np.ascontiguousarray(free.T))


def paired_points_uncertainty(moved: Array, distances: Array) -> PoseUncertainty:
    """Estimate the uncertainty of a fit to paired points.

    Parameters
    ----------
    moved
        (N, 3) points at the pose.
    distances
        (N,) distances from their partners.
    """
    J = np.concatenate([-cross_matrix(moved), np.tile(np.eye(3), (len(moved), 1, 1))], axis=2)
    information = np.einsum("nki,nkj->ij", J, J)
    variance = float(np.square(distances).sum()) / max(3 * len(moved) - 6, 1)
    return PoseUncertainty(variance * np.linalg.pinv(information), np.empty((0, 6)))


def count_degenerate(information: Array) -> int:
    """Count the directions that the information (K, K) calls degenerate."""
    return int((np.linalg.eigvalsh(information) < DEGENERACY_THRESHOLD).sum())


def surface_information(
    sample: Sample, own_normals: Points, planes: TargetPlanes, T: Array, motion_basis: Array
) -> Array:
    """Compute the (K, K) mean of J_i J_i'^T over the motion basis (6, K).

    J comes from the normals of the planes and J' from the sample's own normals (N, 3): the errors
    of the two are independent, so that noise does not pass for shape.
    """
    matches = match_planes(sample, planes, T)
    own = np.einsum("ij,nj->ni", T[:3, :3], own_normals)
    own *= np.sign(np.einsum("ni,ni->n", own, matches.normals))[:, None]
    known = matches.valid & (np.abs(own).sum(axis=1) > 0)
    J, K = (_jacobian(matches.moved, normals)[known] for normals in (matches.normals, own))
    product = _sum_of_products(J, K) / max(known.sum(), 1)
    information: Array = motion_basis.T @ ((product + product.T) / 2) @ motion_basis
    return information


def _gradients(matches: Correspondences, cutoff: float) -> Array:
    """(N, 6) gradients of Tukey's loss of the residuals; 0 beyond the cut-off."""
    pull = matches.tukey_weights(cutoff) * matches.residuals().astype(np.float64)
    return pull[:, None] * _jacobian(matches.moved, matches.normals)


def _jacobian(points: Points, normals: Points) -> Array:
    """(N, 6) derivative of the points' positions along the normals by a small motion."""
    n = normals.astype(np.float64)
    return np.concatenate([np.cross(points.astype(np.float64), n), n], axis=1)


def _sum_of_products(J: Array, K: Array) -> Array:
    """(6, 6) sum of J_i K_i^T over the rows."""
    # no matrix product: BLAS may round differently with another number of threads
    return np.asarray(np.einsum("ni,nj->ij", J, K))


def _scatter_over_patches(matches: Correspondences, gradients: Array, patch: float) -> Array:
    """(6, 6) sum over patches of the outer squares of the patches' sums."""
    cells = CellList(matches.moved, patch, edge=patch)
    sums = np.add.reduceat(gradients[cells.rows], cells.starts[:-1], axis=0)
    return _sum_of_products(sums, sums)


def _stiffness(
    sample: Sample, planes: TargetPlanes, T: Array, count: int, *, smooth: bool
) -> Array:
    """(6, 6) derivative of the gradient, by central differences.

    Held between a twentieth of the stiffness with fixed planes and all of it.
    """
    subset = sample.subset(count)
    share = len(subset.points) / len(sample.points)
    step = DERIVATIVE_STEP * planes.cutoff

    moved = np.repeat(T[None], 12, axis=0)
    for there, motion in zip(moved, step * np.concatenate([-np.eye(6), np.eye(6)]), strict=True):
        update_pose(there, motion)
    before, after = np.split(gradients_at(subset, planes, moved, smooth=smooth), 2)
    N = (before - after).T / (2 * step)
    here = match_planes(subset, planes, T, smooth=smooth)
    J = _jacobian(here.moved, here.normals)[here.tukey_weights(planes.cutoff) > 0]
    fixed = np.linalg.cholesky(_sum_of_products(J, J) + (1e-9 * len(J) + 1e-12) * np.eye(6))
    inner = np.linalg.solve(fixed, np.linalg.solve(fixed, (N + N.T) / 2).T)
    value, axes = np.linalg.eigh((inner + inner.T) / 2)
    side = fixed @ axes
    stiffness: Array = (side * np.clip(value, 0.05, 1)) @ side.T / share
    return stiffness
