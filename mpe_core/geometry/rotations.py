"""Evenly spread rotations."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

PHI = np.sqrt(2.0)
"""First constant of the spiral on the 3-sphere."""
PSI = 1.533751168755204288118041
"""Second constant of the spiral: the root of psi^4 = psi + 4."""


@lru_cache(maxsize=4)
def even_rotations(count: int) -> NDArray[np.float64]:
    """Return (count, 3, 3) rotations spread evenly over SO(3).

    Super-Fibonacci spirals (Alexa, CVPR 2022): a low-discrepancy sequence of unit quaternions.
    """
    s = np.arange(count) + 0.5
    r, q = np.sqrt(s / count), np.sqrt(1 - s / count)
    alpha, beta = 2 * np.pi * s / PHI, 2 * np.pi * s / PSI
    x, y, z, w = r * np.sin(alpha), r * np.cos(alpha), q * np.sin(beta), q * np.cos(beta)
    # not by scipy's Rotation, whose rounding would change the bits of every registration
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0))
