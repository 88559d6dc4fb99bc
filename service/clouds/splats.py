"""Rotation of Gaussian splats: quaternions and spherical harmonics.

Conventions of 3D Gaussian splatting (Kerbl et al., 2023): ``rot_0`` to ``rot_3`` are w, x, y, z;
``f_rest_i`` lists the harmonics of degree 1 and above, all of red, then green, then blue.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from service.clouds.quaternions import multiply, to_quaternion

Attributes = dict[str, NDArray[np.generic]]
_QUATERNION = ("rot_0", "rot_1", "rot_2", "rot_3")
_DIRECTIONS = 64
"""Directions at which the rotated harmonics are fitted; 16 functions need at least 16."""


def rotate_splats(attributes: Attributes, R: NDArray[np.float64]) -> Attributes:
    """Return the quaternions and harmonics of splats as seen after the rotation."""
    return _rotate_quaternions(attributes, R) | _rotate_harmonics(attributes, R)


def _rotate_quaternions(attributes: Attributes, R: NDArray[np.float64]) -> Attributes:
    if not all(name in attributes for name in _QUATERNION):
        return {}
    quaternions = np.stack([attributes[name] for name in _QUATERNION], axis=1).astype(np.float64)
    turned = multiply(to_quaternion(R), quaternions)
    return _with_types(attributes, dict(zip(_QUATERNION, turned.T, strict=True)))


def _rotate_harmonics(attributes: Attributes, R: NDArray[np.float64]) -> Attributes:
    count = sum(name.startswith("f_rest_") for name in attributes)
    degree = {9: 1, 24: 2, 45: 3}.get(count)
    names = [f"f_rest_{i}" for i in range(count)]
    if degree is None or not all(name in attributes for name in names):
        return {}
    table = np.stack([attributes[name] for name in names], axis=1).astype(np.float64)
    channels = table.reshape(len(table), 3, count // 3)
    turned = np.empty_like(channels)
    matrix = _harmonics_matrix(R, degree)
    np.einsum("ij,ncj->nci", matrix, channels, out=turned)
    return _with_types(attributes, dict(zip(names, turned.reshape(len(table), -1).T, strict=True)))


def _harmonics_matrix(R: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    """Return the matrix that turns coefficients of degree 1 to `degree`."""
    directions = np.random.default_rng(0).normal(size=(_DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    size = (degree + 1) ** 2 - 1
    after, before = _harmonics(directions)[:, :size], _harmonics(directions @ R)[:, :size]
    return np.asarray(np.linalg.lstsq(after, before, rcond=None)[0], np.float64)


def _harmonics(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evaluate the real spherical harmonics of degree 1 to 3: (N, 15)."""
    x, y, z = directions.T
    xx, yy, zz = x * x, y * y, z * z
    return np.stack(
        [
            *(-0.4886025119029199 * y, 0.4886025119029199 * z, -0.4886025119029199 * x),
            *(1.0925484305920792 * x * y, -1.0925484305920792 * y * z),
            0.31539156525252005 * (2 * zz - xx - yy),
            *(-1.0925484305920792 * x * z, 0.5462742152960396 * (xx - yy)),
            -0.5900435899266435 * y * (3 * xx - yy),
            2.890611442640554 * x * y * z,
            -0.4570457994644658 * y * (4 * zz - xx - yy),
            0.3731763325901154 * z * (2 * zz - 3 * xx - 3 * yy),
            -0.4570457994644658 * x * (4 * zz - xx - yy),
            1.445305721320277 * z * (xx - yy),
            -0.5900435899266435 * x * (xx - 3 * yy),
        ],
        axis=1,
    )


def _with_types(attributes: Attributes, turned: dict[str, NDArray[np.float64]]) -> Attributes:
    return {name: column.astype(attributes[name].dtype) for name, column in turned.items()}
