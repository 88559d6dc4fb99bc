"""Adapter that exchanges source and target of the search, so that the smaller cloud is moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.assess.confidence import Evidence
from mpe_core.assess.rivals import ScoredPose
from mpe_core.clouds.full_sight import FullSight
from mpe_core.clouds.preprocess import PreparedCloud
from mpe_core.geometry.cell_list import Points
from mpe_core.geometry.rigid import inverse
from mpe_core.pipeline import PosePipeline
from mpe_core.progress import Progress
from mpe_core.refine.covariance import PoseUncertainty
from mpe_core.refine.minimum import Minimum
from mpe_core.refine.swapped import PlaneRefiner
from mpe_core.search.pose_search import SEARCH_LEVELS, SearchLevel

Array = NDArray[np.float64]


class ExchangedPipeline:
    """Poses of the source on the target, found by moving the target over the source.

    What is measured is the share of the moved cloud that fits: of the smaller one it says more. And
    both orders of a pair get the same answer.
    """

    def __init__(self, inner: PosePipeline, planes: PlaneRefiner) -> None:
        """Wrap a pipeline of which the target is the moving cloud.

        Parameters
        ----------
        inner
            Pipeline of the exchanged clouds.
        planes
            What matches points of the source with the planes of the target.
        """
        self._inner = inner
        self.planes = planes

    @property
    def has_noise(self) -> bool:
        """Whether noise hides the planes of one of the clouds."""
        return self._inner.has_noise

    @property
    def clouds(self) -> tuple[PreparedCloud, PreparedCloud]:
        """Source and target."""
        target, source = self._inner.clouds
        return source, target

    @property
    def sights(self) -> tuple[FullSight, FullSight] | None:
        """Places of full sight in source and target that stand for viewpoints, if any do."""
        return None if self._inner.sights is None else self._inner.sights[::-1]

    def coarse_points(self) -> tuple[Points, Points]:
        """Points (N, 3) of the surfaces of source and target."""
        target, source = self._inner.coarse_points()
        return source, target

    def allows(self, poses: Array) -> NDArray[np.bool_]:
        """(K,) whether the caller's knowledge allows the poses (K, 4, 4)."""
        exchanged = np.array([inverse(T) for T in poses]).reshape(-1, 4, 4)
        return self._inner.allows(exchanged)

    def run(
        self, progress: Progress, levels: Sequence[SearchLevel] = SEARCH_LEVELS
    ) -> list[ScoredPose]:
        """Find the pose with the best evidence, followed by those that fit as well."""
        return [_exchanged(pose) for pose in self._inner.run(progress, levels)]

    def refine(self, T: Array) -> ScoredPose:
        """Refine and score a coarse pose T (4, 4)."""
        return _exchanged(self._inner.refine(inverse(T)))

    def finish(self, pose: ScoredPose) -> ScoredPose:
        """Bring a pose to its end, as exact as it gets."""
        return _exchanged(self._inner.finish(_exchanged(pose)))

    def score(self, T: Array) -> Evidence:
        """Measure the evidence for the pose T (4, 4)."""
        return self._inner.score(inverse(T))

    def uncertainty(self, minimum: Minimum) -> PoseUncertainty:
        """Estimate the error of the minimum, as a motion about the target's origin."""
        return self._inner.uncertainty(minimum.inverse()).of_inverse(minimum.T)


Pipeline = PosePipeline | ExchangedPipeline


def _exchanged(pose: ScoredPose) -> ScoredPose:
    return replace(pose, minimum=pose.minimum.inverse())
