"""Interface of the refiners."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mpe_core.refine.covariance import PoseUncertainty
from mpe_core.refine.minimum import Minimum


class Refiner(Protocol):
    """Method that brings a coarse pose to the minimum next to it."""

    def refine(self, T: NDArray[np.float64]) -> Minimum:
        """Find the minimum next to the pose T (4, 4), or come near it."""

    def refine_all(self, poses: NDArray[np.float64]) -> list[Minimum]:
        """Find the minimum next to each of the poses (K, 4, 4), or come near it."""

    def settle(self, minimum: Minimum) -> Minimum:
        """Go on to the minimum from where a refinement ran out of steps."""

    def sharpen(self, minimum: Minimum) -> Minimum:
        """Make a minimum more exact where the clouds are clean and dense; else return itself."""

    def uncertainty(self, minimum: Minimum) -> PoseUncertainty:
        """Estimate the error of the minimum, as a motion about the target's origin."""
