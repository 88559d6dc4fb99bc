"""What speaks for and against the poses of a pair: points, free space, and the view from above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from mpe_core.assess.confidence import MAX_CALIBRATED_SIZE_RATIO
from mpe_core.assess.free_space import FreeSpace
from mpe_core.assess.layer_match import LayerMatch
from mpe_core.assess.rivals import ScoredPose
from mpe_core.assess.score import PoseScorer
from mpe_core.clouds.full_sight import FullSight, find_full_sight
from mpe_core.clouds.ground import stands_out
from mpe_core.clouds.preprocess import PreparedCloud
from mpe_core.refine.regime import Regime
from mpe_core.refine.swapped import PlaneRefiner
from mpe_core.search.box_turns import box_turns
from mpe_core.search.levelled_pair import LevelledPair, level_clouds


@dataclass(frozen=True)
class Judge:
    """Measures the evidence for poses of a source on a target."""

    source: PreparedCloud
    target: PreparedCloud
    planes: PlaneRefiner
    """What matches points with planes."""
    regime: Regime
    """What noise and density of the clouds ask for."""
    overlap: float
    """Share of the source that is known to overlap; 1 where it is not known."""
    size_ratio: float
    """Radius of the larger cloud over that of the smaller one."""
    is_near_start: bool
    """Whether poses are looked for near one that the caller gave."""
    compares_shape: bool
    """Whether points have to meet points of the same local shape."""
    known_levelled: LevelledPair | None = None
    """Both clouds seen from above, where that is known."""
    sights: tuple[FullSight, FullSight] | None = None
    """Places of full sight in source and target that stand for the scanners'; None if none do."""

    @cached_property
    def free_space(self) -> FreeSpace | None:
        """Free space of both clouds; None unless the viewpoints of both are known, and near."""
        x, y = self.source, self.target
        if x.viewpoints is None or y.viewpoints is None:
            return None
        free_space = FreeSpace(x.fine, y.fine, x.viewpoints, y.viewpoints)
        return free_space if free_space.tells_depths else None

    @cached_property
    def scorer(self) -> PoseScorer:
        """Score of single poses."""
        return PoseScorer(
            self.planes,
            self.regime,
            overlap=self.overlap,
            # near an initial pose there are no more chance fits than on a cloud of like size
            size_ratio=1.0 if self.is_near_start else self.size_ratio,
            free_space=self.free_space,
            compares_shape=self.compares_shape,
        )

    @cached_property
    def levelled(self) -> LevelledPair | None:
        """Both clouds seen from above; None unless they are of like size and show a ground."""
        if self.known_levelled is not None:
            return self.known_levelled
        if self.size_ratio > MAX_CALIBRATED_SIZE_RATIO or self.is_near_start:
            return None
        return level_clouds(self.source, self.target)

    @cached_property
    def levelled_evidence(self) -> LevelledPair | None:
        """`levelled`, where the grounds stand out among the planes of both clouds.

        Else each may as well lie on another side, and the view from above is no evidence.
        """
        surfaces = self.source.surface, self.target.surface
        if not all(stands_out(surface.points, surface.normals) for surface in surfaces):
            return None
        return self.levelled

    @cached_property
    def shows_rooms(self) -> bool:
        """Whether both clouds lie along three directions at right angles, as walls do."""
        return all(len(box_turns(cloud.surface)) for cloud in (self.source, self.target))

    def with_layer_support(self, poses: Sequence[ScoredPose]) -> list[ScoredPose]:
        """Compare the poses as seen from above with the best of them."""
        if len(poses) < 2 or self._layers is None:  # one by itself is the best
            return list(poses)
        supports = self._layers.relative_scores(
            [pose.minimum.T for pose in poses], [pose.evidence.is_plausible for pose in poses]
        )
        return [
            replace(pose, evidence=replace(pose.evidence, layer_support=support))
            for pose, support in zip(poses, supports, strict=True)
        ]

    @cached_property
    def _layers(self) -> LayerMatch | None:
        levelled = self.levelled_evidence
        return None if levelled is None else LayerMatch(levelled)

    def from_full_sight(self) -> Judge | None:
        """Return a judge with places of full sight for viewpoints.

        None unless both clouds show their ground, have such places, and no viewpoints are known.
        """
        clouds = self.source, self.target
        if any(cloud.viewpoints is not None for cloud in clouds):
            return None
        levelled = self.levelled_evidence
        if levelled is None:
            return None
        grounds = levelled.source[0].ground, levelled.target.ground
        x = find_full_sight(self.source.surface, grounds[0])
        y = None if x is None else find_full_sight(self.target.surface, grounds[1])
        if x is None or y is None:
            return None
        source, target = (
            replace(cloud, viewpoints=sight.place[None])
            for cloud, sight in zip(clouds, (x, y), strict=True)
        )
        seen = levelled.seen_from(source.viewpoints, target.viewpoints)
        return replace(self, source=source, target=target, known_levelled=seen, sights=(x, y))
