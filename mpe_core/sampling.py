"""Choosing some points of a cloud."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def random_rows(
    points: NDArray[np.float64], count: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """(min(count, N), 3) rows drawn evenly without replacement, in their first order."""
    if count >= len(points):
        return points
    return points[np.sort(rng.choice(len(points), count, replace=False))]
