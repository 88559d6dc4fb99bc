"""Result of an iterative minimisation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.rigid import inverse

Criterion = Literal["point_to_plane", "smoothed_point_to_plane", "full_sum"]

STEP_TOL = 2e-5
"""Step in radians (0.001 degrees) and radii under which an iteration has converged; below it, the
nearest points keep changing places."""


@dataclass(frozen=True, slots=True)
class Minimum:
    """Pose at which an iterative method stopped."""

    T: NDArray[np.float64]
    """(4, 4) T_target_source."""
    converged: bool
    """Whether the last step was below the tolerance; False if the iterations ran out."""
    iterations: int
    """Number of iterations."""
    criterion: Criterion | None = None
    """What is minimal at the pose; None for the methods of the paper."""

    def inverse(self) -> Self:
        """Exchange source and target."""
        return replace(self, T=inverse(self.T))
