"""Rigid motions: poses are (4, 4) float64 and act on column vectors; points are rows (N, 3)."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.validation import is_rotation
from mpe_core.kernels.point_rows import transform_points

Array = NDArray[np.float64]
Scalar = TypeVar("Scalar", bound=np.floating)


def pose(R: Array, t: Array) -> Array:
    """Return the (4, 4) pose of the rotation R (3, 3) and the translation t (3,)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    return T


def apply(T: Array, points: Array | NDArray[np.float32]) -> Array:
    """Return the (N, 3) points R x + t."""
    # no matrix product: BLAS may round differently with another number of threads
    moved = np.empty(points.shape)
    transform_points(np.ascontiguousarray(T), np.ascontiguousarray(points), moved)
    return moved


def mirrored(points: NDArray[Scalar]) -> NDArray[Scalar]:
    """Return the points (N, 3) with x turned to -x."""
    turned = points.copy()
    turned[:, 0] *= -1
    return turned


def inverse(T: Array) -> Array:
    """Return the (4, 4) inverse of a rigid pose, or of a similarity."""
    square_of_scale = np.square(T[:3, :3]).sum() / 3
    M = T[:3, :3].T / square_of_scale
    return pose(M, -M @ T[:3, 3])


def fit(source: Array, target: Array, weights: Array | None = None) -> Array:
    """Fit the rigid pose that minimizes sum_i w_i |y_i - (R x_i + t)|^2 over paired rows.

    Weighted orthogonal Procrustes in closed form (Kabsch 1976; Umeyama 1991, eq. 40-42).

    Parameters
    ----------
    source, target
        (N, 3) points x_i and y_i.
    weights
        (N,) w_i, at least 0; all alike where none are given.

    Returns
    -------
    (4, 4) pose T_target_source.
    """
    w = np.full(len(source), 1 / len(source)) if weights is None else weights / weights.sum()
    x_mean, y_mean = np.einsum("n,ni->i", w, source), np.einsum("n,ni->i", w, target)
    return fit_moments(
        np.einsum("n,ni,nj->ij", w, source - x_mean, target - y_mean), x_mean, y_mean
    )


def fit_moments(covariance: Array, x_mean: Array, y_mean: Array) -> Array:
    """Solve `fit` from sum_i w_i (x_i - x_mean)(y_i - y_mean)^T and both means."""
    U, _, Vt = np.linalg.svd(covariance)
    handedness = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    R = (Vt.T * handedness) @ U.T
    return pose(R, y_mean - R @ x_mean)


def axis_rotation(axis: Array, angle: float) -> Array:
    """Return the (3, 3) rotation by an angle in radians about an axis (3,) of any length but zero.

    Rodrigues' formula. scipy's Rotation rounds differently, which Algorithm 1 amplifies.
    """
    K = cross_matrix(axis / np.linalg.norm(axis))
    R: Array = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)
    return R


def rotation_between(a: Array, b: Array) -> Array:
    """(3, 3) shortest rotation that turns the unit vector a (3,) to the unit vector b (3,).

    Of the half turns between opposite vectors, one is taken.
    """
    axis = np.cross(a, b)
    sine = float(np.linalg.norm(axis))  # 0 also where the squares of a tiny axis vanish
    if sine > 0:
        return axis_rotation(axis, float(np.arctan2(sine, a @ b)))
    if a @ b > 0:
        return np.eye(3)
    return axis_rotation(np.cross(a, np.eye(3)[np.argmin(np.abs(a))]), np.pi)


def cross_matrix(v: Array) -> Array:
    """Return the (..., 3, 3) matrices of p -> v x p, for vectors v (..., 3)."""
    x, y, z = np.moveaxis(v, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def rotation_error(A: Array, B: Array) -> float:
    """Return the angle in degrees of the rotation between two poses (Eq. 11).

    Exact near zero, where arccos of the trace is not.

    Parameters
    ----------
    A, B
        (4, 4) poses or (3, 3) rotations.

    Raises
    ------
    ValueError
        An argument is not a rotation.
    """
    for M in (A, B):
        R = M[:3, :3]
        if not is_rotation(R):
            raise ValueError(f"expected a rotation matrix, got\n{R}")
    D = A[:3, :3].T @ B[:3, :3]
    sine = np.linalg.norm([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    return float(np.degrees(np.arctan2(sine, np.trace(D) - 1)))
