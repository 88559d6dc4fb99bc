"""Which coordinates and poses are valid.

The options import this module, so it must not load the compiled kernels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_COORDINATE = 1e15
"""Largest absolute coordinate: beyond it float64 steps are larger than an eighth of the unit."""

MIN_EXTENT = 1e-150
"""Smallest distance of a point from the centre of its cloud: squares of smaller ones vanish."""

ORTHONORMALITY_TOL = 1e-6
"""Largest absolute entry of R^T R - 1 of a rotation."""


def is_rotation(R: Array) -> bool:
    """Whether a (3, 3) matrix is orthonormal with determinant 1."""
    return bool(np.abs(R.T @ R - np.eye(3)).max() < ORTHONORMALITY_TOL and np.linalg.det(R) > 0)


def is_rigid(T: Array) -> bool:
    """Whether a (4, 4) matrix is a rotation and a translation."""
    return is_rotation(T[:3, :3]) and bool((T[3] == (0, 0, 0, 1)).all())
