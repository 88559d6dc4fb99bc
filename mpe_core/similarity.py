"""Similarities: a pose together with the scale of the source, refined next to a rigid pose.

The clouds stay prepared as they are: the rotation of the pose between them is times the change of
the scale, which matching, descent and evidence bear.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.assess.rivals import ScoredPose
from mpe_core.refine.scale import ScaleStep, estimate_scale_step
from mpe_core.refine.swapped import SwappedPointToPlane
from mpe_core.rigid_registration import Attempt

Array = NDArray[np.float64]

MAX_STEPS, STEP_TOL = 12, 1e-6
"""Steps of the scale, and the last step's logarithm at which it stops."""

MAX_STEP = 0.1
"""Largest logarithm of one step."""

STEPS_AHEAD = 10.0
"""Bound on the sum of this and all further steps of the scale, over this one (docs/tuning.md)."""


@dataclass(frozen=True, slots=True)
class Similarity:
    """Pose of a registration with the source larger by a factor."""

    attempt: Attempt
    """Registration next to which it lies."""
    pose: ScoredPose
    """Pose between the normalized clouds; its rotation is times `factor`."""
    factor: float = 1.0
    """Scale of the source over that of the registration."""
    deviation: float = 0.0
    """Standard deviation of the factor."""

    @property
    def rigid_pose(self) -> Array:
        """(4, 4) rigid pose between the caller's clouds, the source times `factor`."""
        T = self.attempt.pair.to_caller(self.pose.minimum.T)
        T[:3, :3] /= self.factor
        return T

    def scaled(self, change: float) -> Similarity:
        """Return the similarity at another scale, its pose refined."""
        T = self.pose.minimum.T.copy()
        T[:3, :3] *= change  # about the centre of mass, where the normalized source has its origin
        pose = self.attempt.pipeline.refine(T)
        return replace(self, pose=pose, factor=self.factor * change)

    def step(self) -> ScaleStep | None:
        """Step of the scale next to the pose; None where too little matches."""
        planes = self.attempt.pipeline.planes
        step = estimate_scale_step(planes.match(self.pose.minimum.T), planes.radius / 2)
        if step is not None and isinstance(planes, SwappedPointToPlane):
            return replace(step, log_scale=-step.log_scale)
        return step


def refine_scale(
    attempt: Attempt, step_tol: float = STEP_TOL, least_change: float = 0.0
) -> Similarity:
    """Alternate steps of the scale and refinements of the pose.

    Parameters
    ----------
    attempt
        Registration from whose pose they start.
    step_tol
        Logarithm of the step at which they end.
    least_change
        They also end where the logarithm of the scale will stay below it.
    """
    found = Similarity(attempt, attempt.best)
    for _ in range(MAX_STEPS):
        step = found.step()
        if step is None:
            break
        found = replace(found, deviation=step.deviation * found.factor)
        log_change = float(np.clip(step.log_scale, -MAX_STEP, MAX_STEP))
        farthest = abs(np.log(found.factor)) + STEPS_AHEAD * abs(log_change)
        if abs(log_change) < step_tol or farthest < least_change:
            break
        found = found.scaled(float(np.exp(log_change)))
    return found
