"""Which coordinates and poses are valid; apart from the kernels, which the options do not load."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LARGEST_COORDINATE = 1e15
"""Beyond it float64 resolves no more than an eighth of the unit."""

ORTHONORMALITY = 1e-6
"""Largest |R^T R - 1| that still counts as a rotation."""


def is_rotation(R: Array) -> bool:
    """Whether a (3, 3) matrix is orthonormal and keeps hands."""
    return bool(np.abs(R.T @ R - np.eye(3)).max() < ORTHONORMALITY and np.linalg.det(R) > 0)


def is_rigid(T: Array) -> bool:
    """Whether a (4, 4) matrix is a rotation and a translation."""
    return is_rotation(T[:3, :3]) and bool((T[3] == (0, 0, 0, 1)).all())
