"""The P2 criterion of a pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def p2_energy(distance: Array, eps: float) -> float:
    """P2 criterion (Eq. 10) of a pose from the distances (N,) of the source points to their nearest
    target points, K_i = eps^2: -mean eps^2 / (d^2 + eps^2), in [-1, 0]; lower is better."""
    return -float(np.mean(eps**2 / (distance**2 + eps**2)))
