"""P2 criterion of a pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def p2_energy(distances: NDArray[np.float64], eps: float) -> float:
    """Compute the P2 criterion (Eq. 10 of the paper) with K_i = eps^2.

    Parameters
    ----------
    distances
        (N,) distances of the source points from their nearest target points; may be infinite.
    eps
        Softening length in the same unit.

    Returns
    -------
    float
        -mean eps^2 / (d^2 + eps^2), in [-1, 0]; lower is better.
    """
    return -float(np.mean(eps**2 / (distances**2 + eps**2)))
