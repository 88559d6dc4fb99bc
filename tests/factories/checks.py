"""Comparing poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.rigid import apply, inverse, rotation_error

Array = NDArray[np.float64]


def pose_error(T: Array, truth: Array, source: Array) -> tuple[float, float]:
    """Rotation between the poses in degrees, and how far apart they put the source's centroid."""
    centroid = source.mean(axis=0, keepdims=True)
    return rotation_error(T, truth), float(
        np.linalg.norm(apply(T, centroid) - apply(truth, centroid))
    )


def assert_pose_close(
    T: Array, truth: Array, source: Array, *, degrees: float, shift: float
) -> None:
    """The pose is right to degrees and shift; the start (identity) and the inverse are not."""
    turned, moved = pose_error(T, truth, source)
    assert turned <= degrees, f"{turned:.4g} degrees off, {degrees} allowed"
    assert moved <= shift, f"{moved:.4g} off, {shift} allowed"
    for wrong in (np.eye(4), inverse(truth)):
        turned, moved = pose_error(wrong, truth, source)
        assert turned > degrees or moved > shift, "identity or inverse would pass: no test"
