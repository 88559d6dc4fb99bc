"""Rigid motions: poses are (4, 4) float64 of column vectors, points are rows (N, 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.validation import is_rotation
from mpe_core.kernels.point_rows import transformed

Array = NDArray[np.float64]


def pose(R: Array, t: Array) -> Array:
    """(4, 4) pose of the rotation R (3, 3) and the translation t (3,)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    return T


def apply(T: Array, points: Array | NDArray[np.float32]) -> Array:
    """(N, 3) points R x + t."""
    # no matrix product: BLAS may round differently with another number of threads
    found = np.empty(points.shape)
    transformed(np.ascontiguousarray(T), np.ascontiguousarray(points), found)
    return found


def inverse(T: Array) -> Array:
    """(4, 4) inverse of a rigid pose."""
    R = T[:3, :3].T
    return pose(R, -R @ T[:3, 3])


def fit(source: Array, target: Array, weights: Array | None = None) -> Array:
    """(4, 4) rigid pose that minimises sum_i w_i |y_i - (R x_i + t)|^2 over paired rows.

    Weighted orthogonal Procrustes in closed form (Kabsch 1976, Umeyama 1991, eq. 40-42).
    """
    w = np.full(len(source), 1 / len(source)) if weights is None else weights / weights.sum()
    x_mean, y_mean = np.einsum("n,ni->i", w, source), np.einsum("n,ni->i", w, target)
    return fit_moments(
        np.einsum("n,ni,nj->ij", w, source - x_mean, target - y_mean), x_mean, y_mean
    )


def fit_moments(covariance: Array, x_mean: Array, y_mean: Array) -> Array:
    """(4, 4) solution of `fit` from sum_i w_i (x_i - x_mean)(y_i - y_mean)^T and both means."""
    U, _, Vt = np.linalg.svd(covariance)
    handedness = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    R = (Vt.T * handedness) @ U.T
    return pose(R, y_mean - R @ x_mean)


def axis_rotation(axis: Array, angle: float) -> Array:
    """(3, 3) rotation by angle (radians) about axis (3,), of any length but zero (Rodrigues)."""
    K = cross_matrix(axis / np.linalg.norm(axis))
    R: Array = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)
    return R


def cross_matrix(v: Array) -> Array:
    """(3, 3) matrix of p -> v x p."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_error(A: Array, B: Array) -> float:
    """Angle in degrees of the rotation between two poses (4, 4) or rotations (3, 3); Eq. 11.

    Exact near zero, where arccos of the trace is not.

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


def random_rotation(rng: np.random.Generator) -> Array:
    """(3, 3) rotation drawn evenly from SO(3): a normal quaternion, scaled to length 1."""
    q = rng.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
