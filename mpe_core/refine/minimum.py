"""Where an iterative method came to rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Minimum:
    """A pose at rest."""

    T: NDArray[np.float64]
    """(4, 4) T_target_source."""
    converged: bool
    """Whether the last step was below the tolerance; False: the iterations ran out."""
    iterations: int
    is_planar: bool = False
    """Whether the distances from planes are minimal there; False: the potential is."""
    is_smoothed: bool = False
    """Whether the points were laid on the planes through their neighbours first."""
