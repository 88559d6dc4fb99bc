"""How far to trust a pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LOOSE = 4.0
MIDDLE, STEEPNESS = 0.65, 20.0


def sharpness(distance: NDArray[np.float64], sharp: float) -> float:
    """Share of the source points near the target (within LOOSE * sharp) that lie on it (within
    sharp); distance (N,) from the source points to their nearest target points.

    At the true pose the points that are near the target lie on its surface; at a wrong pose their
    distances spread.
    """
    near = distance < LOOSE * sharp
    return float((distance[near] < sharp).mean()) if near.any() else 0.0


def confidence(distance: NDArray[np.float64], sharp: float) -> float:
    """How likely the pose is right, in [0, 1]: a logistic function of the sharpness."""
    return float(1 / (1 + np.exp(-STEEPNESS * (sharpness(distance, sharp) - MIDDLE))))
