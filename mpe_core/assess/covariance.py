"""How exactly a polished pose is known, and in which directions not at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.preprocess import Sample
from mpe_core.geometry.cell_list import CellList, Points
from mpe_core.geometry.rigid import cross_matrix
from mpe_core.kernels.rigid_motion import update_pose
from mpe_core.refine.full_sum import PotentialExpansion
from mpe_core.refine.point_to_plane import Correspondences, TargetPlanes, nearest_planes

Array = NDArray[np.float64]

FREE = 2e-3
"""Mean squared share of a unit motion along the normals, under which nothing resists it. Sphere,
cylinder, plane and a straight street with noise up to 0.01: at most 0.0005 in their free
directions; 84 of the 85 shared pairs: at least 0.003 in all (0.02 degrees of error there)."""

PROBE = 0.3
"""Step of the numerical derivative over the cut-off of the residuals: with fixed planes instead,
the bunny with noise 0.006 would pass for 2.4 times as exact as it is."""

STIFFNESS_POINTS = 500
"""Points that the derivative is taken on."""

PROBED_POINTS = 1000
"""Points of which planes through their own neighbours are fitted, too."""


@dataclass(frozen=True, slots=True)
class PoseUncertainty:
    """Of a pose T, in small motions exp(rotation vector, translation) T about the fixed frame's
    origin; radians and radii of the smaller cloud."""

    covariance: Array
    """(6, 6); along free directions as wide as the clouds: 1."""
    free: Array
    """(K, 6) motions that the surfaces do not resist."""

    def seen_from_target(self, T_target_source: Array) -> PoseUncertainty:
        """Of the inverse of a pose of the target in the source's frame."""
        R, t = T_target_source[:3, :3], T_target_source[:3, 3]
        adjoint = np.zeros((6, 6))
        adjoint[:3, :3] = adjoint[3:, 3:] = R
        adjoint[3:, :3] = cross_matrix(t) @ R
        return self.through(adjoint)

    def about(self, centre: Array) -> PoseUncertainty:
        """Of motions about the centre (3,)."""
        shift = np.eye(6)
        shift[3:, :3] = -cross_matrix(centre)
        return self.through(shift)

    def in_unit(self, unit: float) -> PoseUncertainty:
        """Of motions whose translation is in the caller's unit, of which 1 radius has `unit`."""
        return self.through(np.diag([1.0] * 3 + [unit] * 3))

    def through(self, change: Array) -> PoseUncertainty:
        """Of the motions change @ m, change (6, 6)."""
        return PoseUncertainty(change @ self.covariance @ change.T, self.free @ change.T)


def uncertainty(
    source: Sample,
    planes: TargetPlanes,
    T: Array,
    information: Array,
    motions: Array,
    *,
    smooth: bool,
) -> PoseUncertainty:
    """Covariance of the minimum of `point_to_plane`: the sandwich N^-1 B N^-1 of an M-estimator
    (Huber 1967), N the derivative of the gradient, in which points change their planes, and B the
    scatter of the gradient over patches of the surface as wide as a plane (Liang and Zeger 1986):
    points of one patch share the errors of their planes. The information tells which of the
    motions (6, K) are free."""
    pairs = nearest_planes(source, planes, T, smooth=smooth)
    pulls = _pulls(pairs, planes.cut)
    N = _stiffness(source, planes, T, smooth=smooth)
    return sandwich(N, _scatter(pairs, pulls, float(planes.cells.reach)), information, motions)


def count_degenerate(information: Array) -> int:
    """How many directions are free, by the information on them."""
    return int((np.linalg.eigvalsh(information) < FREE).sum())


def sandwich(N: Array, B: Array, information: Array, motions: Array) -> PoseUncertainty:
    """N^-1 B N^-1 in the directions that the information (K, K) over the motions (6, K) tells."""
    value, axes = np.linalg.eigh(information)
    free, known = motions @ axes[:, value < FREE], motions @ axes[:, value >= FREE]
    half = np.linalg.solve(known.T @ N @ known, known.T)
    covariance = free @ free.T + half.T @ (known.T @ B @ known) @ half
    return PoseUncertainty(covariance, np.ascontiguousarray(free.T))


def potential_uncertainty(
    source: Points, target: Points, T: Array, eps: float, motions: Array
) -> PoseUncertainty:
    """Covariance of the minimum of `descend_potential`: the sandwich H^-1 B H^-1, B the scatter of
    the pull over the source's points."""
    here = PotentialExpansion(source, np.ascontiguousarray(target.T), T, eps)
    # turns and moves in units that move the points equally stiffly
    unit = 1 / np.sqrt(np.where(here.scale > 0, here.scale, 1))
    H = here.hessian * np.outer(unit, unit)
    B = np.einsum("ni,nj->ij", here.pulls, here.pulls) * np.outer(unit, unit)
    found = sandwich(H, B, motions.T @ H @ motions, motions)
    return found.through(np.diag(unit)).about(-here.centre)


def _pulls(pairs: Correspondences, cut: float) -> Array:
    """(N, 6) gradients of the residuals' loss, 0 beyond the cut-off."""
    pull = pairs.weights(cut) * pairs.residuals().astype(np.float64)
    return pull[:, None] * _directions(pairs.moved, pairs.normals)


def _directions(points: Points, normals: Points) -> Array:
    """(N, 6) how far points (N, 3) go along their normals by small motions."""
    n = normals.astype(np.float64)
    return np.concatenate([np.cross(points.astype(np.float64), n), n], axis=1)


def _products(J: Array, K: Array) -> Array:
    """(6, 6) sum of J_i K_i^T over the rows."""
    # no matrix product: BLAS may round differently with another number of threads
    return np.asarray(np.einsum("ni,nj->ij", J, K))


def surface_information(
    probe: Sample, own_normals: Points, planes: TargetPlanes, T: Array, motions: Array
) -> Array:
    """(K, K) mean of J_i J_i'^T over the motions (6, K), J from the target's normals and J' from
    the source's own (N, 3): the errors of the two are independent and do not pass for shape."""
    pairs = nearest_planes(probe, planes, T)
    own = np.einsum("ij,nj->ni", T[:3, :3], own_normals)
    own *= np.sign(np.einsum("ni,ni->n", own, pairs.normals))[:, None]
    known = pairs.used & (np.abs(own).sum(axis=1) > 0)
    J, K = (_directions(pairs.moved, normals)[known] for normals in (pairs.normals, own))
    product = _products(J, K) / max(known.sum(), 1)
    information: Array = motions.T @ ((product + product.T) / 2) @ motions
    return information


def _scatter(pairs: Correspondences, pulls: Array, patch: float) -> Array:
    """(6, 6) sum over patches of the outer squares of their sums."""
    cells = CellList(pairs.moved, patch, edge=patch)
    sums = np.add.reduceat(pulls[cells.rows], cells.starts[:-1], axis=0)
    return _products(sums, sums)


def _stiffness(source: Sample, planes: TargetPlanes, T: Array, *, smooth: bool) -> Array:
    """(6, 6) derivative of the gradient, by central differences, never stiffer than with fixed
    planes nor less than a twentieth of that."""
    some = source.part(STIFFNESS_POINTS)
    share = len(some.points) / len(source.points)
    step = PROBE * planes.cut

    def pull(motion: Array) -> Array:
        there = T.copy()
        update_pose(there, motion)
        pairs = nearest_planes(some, planes, there, smooth=smooth)
        total: Array = _pulls(pairs, planes.cut).sum(axis=0)
        return total

    N = np.column_stack([pull(-d) - pull(d) for d in step * np.eye(6)]) / (2 * step)
    here = nearest_planes(some, planes, T, smooth=smooth)
    J = _directions(here.moved, here.normals)[here.weights(planes.cut) > 0]
    fixed = np.linalg.cholesky(_products(J, J) + (1e-9 * len(J) + 1e-12) * np.eye(6))
    inner = np.linalg.solve(fixed, np.linalg.solve(fixed, (N + N.T) / 2).T)
    value, axes = np.linalg.eigh((inner + inner.T) / 2)
    side = fixed @ axes
    stiffness: Array = (side * np.clip(value, 0.05, 1)) @ side.T / share
    return stiffness
