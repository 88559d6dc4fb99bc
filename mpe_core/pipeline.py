"""The default method: search over all poses, refinement, and a wider search if none convinces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpe_core.assess.completeness import Completeness
from mpe_core.assess.confidence import MAX_CALIBRATED_SIZE_RATIO, Evidence
from mpe_core.assess.judge import Judge
from mpe_core.assess.near_start import prefer_near_start
from mpe_core.assess.rivals import (
    ScoredPose,
    beside_only_complete,
    select_distinct,
    select_equal,
    with_contrast,
)
from mpe_core.clouds.full_sight import FullSight
from mpe_core.clouds.preprocess import PreparedCloud
from mpe_core.geometry.cell_list import Points
from mpe_core.options import RegistrationOptions
from mpe_core.progress import FractionCallback, Progress
from mpe_core.refine.covariance import PoseUncertainty
from mpe_core.refine.full_sum import FullSum
from mpe_core.refine.minimum import Minimum
from mpe_core.refine.point_to_plane import PRESELECT_STEPS, PointToPlane
from mpe_core.refine.refiner import Refiner
from mpe_core.refine.regime import Regime, choose_regime
from mpe_core.refine.swapped import PlaneRefiner, SwappedPointToPlane
from mpe_core.search.candidate_search import CandidateSearch
from mpe_core.search.levelled_effort import THOROUGH_LEVELLED, LevelledEffort
from mpe_core.search.pose_prior import PosePrior
from mpe_core.search.pose_search import SEARCH_LEVELS, Candidates, SearchLevel, are_close

Array = NDArray[np.float64]

REFINE_ABOVE = 0.7
"""Share of the best candidate's score from which on a candidate is refined and compared."""

MAX_REFINED = 8
"""Candidates of a search that are refined fully; the others are left after a short refinement of
some of their points (docs/tuning.md)."""

REFINED_TOGETHER = 2
"""Candidates that are refined together until one convinces (docs/tuning.md)."""

MAX_SCORE_GAP = 3.0
"""Score by which a candidate may fall short of the best one after the short refinement and still be
refined fully (docs/tuning.md)."""

UNRIVALLED_CONFIDENCE = 0.985
"""Confidence of a pose from which on its clouds are not searched levelled, where free space has not
told it from slides: no levelled search has changed such a pose (docs/tuning.md)."""

MIN_FIRST_SCORE = 0.5
"""Score by itself of a pose that ends the first search: it has met few rivals (docs/tuning.md)."""


@dataclass(frozen=True, slots=True)
class _Preselected:
    """Candidate after a short refinement."""

    row: int
    """Its row among the candidates."""
    T: Array
    """(4, 4) pose that the short refinement reached."""
    weak_evidence: Evidence | None = None
    """Evidence of one that falls too far short of the best one to be refined fully."""


class PosePipeline:
    """Search, refinement and scoring of poses between two prepared clouds."""

    def __init__(
        self,
        source: PreparedCloud,
        target: PreparedCloud,
        prior: PosePrior,
        options: RegistrationOptions,
        size_ratio: float = 1.0,
        *,
        compares_shape: bool = True,
        trial_score: float | None = None,
    ) -> None:
        """Choose the refiner that suits noise and density of the clouds.

        Parameters
        ----------
        source, target
            Prepared clouds.
        prior
            What the caller knows about the pose.
        options
            Options of the registration.
        size_ratio
            Radius of the larger cloud over that of the smaller one.
        compares_shape
            Whether points have to meet points of the same local shape.
        trial_score
            Score by itself that a pose has to reach to be of use, where `run` is a trial: it leaves
            the best pose where its comparison with others left it. None where it is none.
        """
        self.source, self.target, self._prior, self._options = source, target, prior, options
        self._size_ratio, self._trial_score = size_ratio, trial_score
        self._regime = choose_regime(source, target)
        planes = choose_planes(source, target, prior, self._regime, options)
        self.judge = Judge(
            source,
            target,
            planes,
            self._regime,
            overlap=options.overlap or 1.0,
            size_ratio=size_ratio,
            is_near_start=prior.initial is not None,
            compares_shape=compares_shape,
        )
        self.planes = planes
        self.search = CandidateSearch(source, target, prior, options.seed)
        self.refiner: Refiner = planes
        if self._regime.uses_full_sum:
            self.refiner = FullSum(
                source,
                target,
                prior.motion_basis(),
                options.max_iterations,
                planes,
                lambda T: self.judge.scorer.score(T).on_surface_fraction,
            )

    def run(
        self, progress: Progress, levels: Sequence[SearchLevel] = SEARCH_LEVELS
    ) -> list[ScoredPose]:
        """Find the pose with the best evidence, followed by those that fit as well.

        Levels of the search follow one another until one finds a pose that convinces.
        """
        poses: list[ScoredPose] = []
        for level in levels:
            with progress.stage("search") as report:
                candidates = self.search.find(level, report)
            with progress.stage("refine") as report:
                self._refine_candidates(candidates, level, poses, report)
            if all(pose.evidence.score < self._least_score for pose in poses):
                break  # comparisons only take from a score
            poses = self.compare(poses)
            if level is levels[0] and self._may_look_from_full_sight(poses):
                poses = self._look_from_full_sight(poses)
            if level.levelled and not self._is_told_from_slides(poses, level):
                poses = self._search_levelled(poses, level.levelled, progress)
            if self._has_convincing(poses, level) and self._may_be_turned(poses):
                poses = self._search_turned(poses, progress)
            if self._has_convincing(poses, level):
                break
        while True:
            best, *others = select_equal(self._in_order(poses))
            if self._trial_score is not None:
                return [best, *others]
            finished = self.finish(best)
            if finished.evidence is best.evidence:
                return [finished, *others]
            rest = [pose for pose in poses if pose.minimum is not best.minimum]
            poses = self.compare([finished, *rest])

    def _in_order(self, poses: list[ScoredPose]) -> list[ScoredPose]:
        """Order the poses, best first."""
        ordered = sorted(poses, key=lambda pose: pose.evidence.sort_key, reverse=True)
        if self._prior.initial is None:
            return ordered
        return self._prefer_near_start(self._prior.initial, ordered)

    def _prefer_near_start(self, start: Array, ordered: list[ScoredPose]) -> list[ScoredPose]:
        """Order the poses and that next to the start: near ones first, within the given range."""
        # others elsewhere do not count against a pose where the caller said it is
        alone = [replace(pose, evidence=replace(pose.evidence, contrast=None)) for pose in ordered]
        poses = [*alone, self.refine(start)]
        if self._options.max_rotation_deg or self._options.max_translation:
            in_range = self._prior.accepts(np.array([pose.minimum.T for pose in poses]))
            poses = [pose for pose, is_near in zip(poses, in_range, strict=True) if is_near]
            poses = poses or [ScoredPose(Minimum(start, False, 0), self.judge.scorer.score(start))]
        return prefer_near_start(poses, lambda pose: self._prior.distance(pose.minimum.T))

    @property
    def _least_score(self) -> float:
        """Score by itself from which on a pose is of use."""
        return -np.inf if self._trial_score is None else self._trial_score

    @property
    def has_noise(self) -> bool:
        """Whether noise hides the planes of one of the clouds."""
        return self._regime.is_noisy

    @property
    def clouds(self) -> tuple[PreparedCloud, PreparedCloud]:
        """Source and target."""
        return self.source, self.target

    def coarse_points(self) -> tuple[Points, Points]:
        """Points (N, 3) of both surfaces."""
        return self.source.surface.points, self.target.surface.points

    def allows(self, poses: Array) -> NDArray[np.bool_]:
        """(K,) whether the caller's knowledge allows the poses (K, 4, 4)."""
        return self._prior.accepts(poses)

    def score(self, T: Array) -> Evidence:
        """Measure the evidence for the pose T (4, 4)."""
        return self.judge.scorer.score(T)

    def uncertainty(self, minimum: Minimum) -> PoseUncertainty:
        """Estimate the error of the minimum, as a motion about the target's origin."""
        return self.refiner.uncertainty(minimum)

    def _search_levelled(
        self, poses: list[ScoredPose], effort: LevelledEffort, progress: Progress
    ) -> list[ScoredPose]:
        """Add the poses of a levelled search; where no ground stands out, of rooms alone, last."""
        may_be_room = effort is THOROUGH_LEVELLED and self.judge.shows_rooms
        levelled = self.judge.levelled if may_be_room else self.judge.levelled_evidence
        if levelled is None:
            return poses
        with progress.stage("search") as report:
            candidates = self.search.find_levelled(levelled, effort, report)
        return self._with_rivals(poses, candidates, progress)

    def _search_turned(self, poses: list[ScoredPose], progress: Progress) -> list[ScoredPose]:
        """Add the poses that turn the best one as a box fits on itself."""
        best = max(poses, key=lambda pose: pose.evidence.sort_key)
        with progress.stage("search") as report:
            candidates = self.search.find_turned(best.minimum.T, report)
        return self._with_rivals(poses, candidates, progress)

    def _with_rivals(
        self, poses: list[ScoredPose], candidates: Candidates, progress: Progress
    ) -> list[ScoredPose]:
        """Add the promising of the candidates, and compare all poses anew."""
        if not len(candidates.poses):
            return poses
        with progress.stage("refine") as report:
            promising = self._preselect(candidates.poses, poses, report)
            rivals = self._refine_preselected(promising)
        return self.compare([*poses, *rivals])

    def refine(self, T: Array) -> ScoredPose:
        """Refine and score a coarse pose T (4, 4)."""
        return self._refine_all([T])[0]

    def _refine_all(self, poses: Sequence[Array]) -> list[ScoredPose]:
        """Refine and score coarse poses (4, 4)."""
        if not poses:
            return []
        starts = np.array([self._prior.project_to_yaw(T) for T in poses])
        minima = self.refiner.refine_all(starts)
        return [ScoredPose(minimum, self.judge.scorer.score(minimum.T)) for minimum in minima]

    def finish(self, pose: ScoredPose) -> ScoredPose:
        """Bring a pose to its end, as exact as it gets; what speaks for it stays what it was.

        One whose minimum lies elsewhere was still on its way: it is measured there, by itself,
        unless the caller said where it is.
        """
        sharp = _moved(pose, self.refiner.sharpen(pose.minimum))
        if sharp.minimum is not pose.minimum or pose.minimum.converged:
            return sharp
        settled = self.refiner.settle(pose.minimum)
        if are_close(settled.T, pose.minimum.T):
            return replace(pose, minimum=settled)
        if self._prior.initial is not None:
            return pose
        return ScoredPose(settled, self.judge.scorer.score(settled.T))

    def _settle(self, pose: ScoredPose) -> ScoredPose:
        """Bring a pose that ran out of steps to its minimum."""
        return pose if pose.minimum.converged else _moved(pose, self.refiner.settle(pose.minimum))

    def _refine_candidates(
        self,
        candidates: Candidates,
        level: SearchLevel,
        poses: list[ScoredPose],
        report: FractionCallback,
    ) -> None:
        """Refine the promising candidates, best first, and append them to the poses.

        Once a pose convinces, only candidates that score nearly as well as the best are refined.
        """
        least = REFINE_ABOVE * candidates.scores[0]
        if not (candidates.scores[1:] >= least).any():
            poses.append(self.refine(candidates.poses[0]))
            candidates = Candidates(candidates.poses[1:], candidates.scores[1:])
            if len(candidates.poses) == 0 or self._has_convincing(poses, level):
                return
        promising = self._preselect(candidates.poses, poses, lambda share: report(share / 2))
        rivals = [near for near in promising if candidates.scores[near.row] >= least]
        poses += self._refine_preselected(rivals)
        others = [near for near in promising if candidates.scores[near.row] < least]
        for done in range(0, len(others), REFINED_TOGETHER):
            report(0.5 + 0.5 * (len(rivals) + done) / len(promising))
            if self._has_convincing(poses, level):
                break
            poses += self._refine_preselected(others[done : done + REFINED_TOGETHER])

    def _preselect(
        self, poses: Array, known: list[ScoredPose], report: FractionCallback
    ) -> list[_Preselected]:
        """Select up to MAX_REFINED of the poses (K, 4, 4) by a short refinement, best first.

        Those that fall too far short of the best one, known poses included, are not refined fully.
        """
        if self._regime.uses_full_sum:
            return [_Preselected(row, T) for row, T in enumerate(poses[:MAX_REFINED])]
        if len(poses) == 0:
            return []
        starts = np.array([self._prior.project_to_yaw(T) for T in poses])
        found: list[tuple[int, Array, Evidence]] = []
        for row, near in enumerate(self.planes.refine_shortly(starts)):
            report(row / len(poses))
            found.append((row, near, self.judge.scorer.score_subset(near)))
        found.sort(key=lambda each: each[2].sort_key, reverse=True)
        rivals = [evidence for _, _, evidence in found] + [pose.evidence for pose in known]
        best = max(evidence.score for evidence in rivals)
        least = max(best, self._least_score) - MAX_SCORE_GAP
        return [
            _Preselected(row, T, None if evidence.score >= least else evidence)
            for row, T, evidence in found[:MAX_REFINED]
        ]

    def _refine_preselected(self, chosen: Sequence[_Preselected]) -> list[ScoredPose]:
        """Refine and score preselected poses; those that fall short stay rivals as they are."""
        refined = iter(self._refine_all([near.T for near in chosen if near.weak_evidence is None]))
        return [
            next(refined)
            if near.weak_evidence is None
            else ScoredPose(Minimum(near.T, False, PRESELECT_STEPS), near.weak_evidence)
            for near in chosen
        ]

    def _has_convincing(self, poses: list[ScoredPose], level: SearchLevel) -> bool:
        """Whether a pose ends the search at this level."""
        is_first = level is SEARCH_LEVELS[0]
        if is_first and self._size_ratio > MAX_CALIBRATED_SIZE_RATIO:
            return False  # a much larger cloud has more places than the first level finds
        least = MIN_FIRST_SCORE if is_first else -np.inf
        return any(
            pose.evidence.confidence >= level.stop_confidence and pose.evidence.score >= least
            for pose in poses
        )

    def _is_told_from_slides(self, poses: list[ScoredPose], level: SearchLevel) -> bool:
        """Whether a pose convinces that needs no comparison with those of the levelled search."""
        least = -np.inf if self.judge.free_space is not None else UNRIVALLED_CONFIDENCE
        sure = [pose for pose in poses if pose.evidence.confidence >= least]
        return self._has_convincing(sure, level)

    def _may_be_turned(self, poses: list[ScoredPose]) -> bool:
        """Whether it is asked how the best pose compares with its turns.

        Not of a sure pose, near an initial one, in a trial, or where noise hides the planes, whose
        refinement takes as long as all else. A small part on a larger cloud has other rivals.
        """
        is_part = self._size_ratio > MAX_CALIBRATED_SIZE_RATIO
        is_told = _is_sure(poses) or is_part or self._prior.initial is not None
        return not (is_told or self._trial_score is not None or self._regime.uses_full_sum)

    def _may_look_from_full_sight(self, poses: list[ScoredPose]) -> bool:
        """Whether places of full sight may stand for viewpoints: of no sure pose."""
        return self._options.infer_viewpoints == "auto" and not _is_sure(poses)

    def _look_from_full_sight(self, poses: list[ScoredPose]) -> list[ScoredPose]:
        """Measure the poses anew by the free space that places of full sight tell, if any do."""
        judge = self.judge.from_full_sight()
        if judge is None:
            return poses
        self.judge = judge
        return self.compare(
            [replace(pose, evidence=judge.scorer.score(pose.minimum.T)) for pose in poses]
        )

    @property
    def sights(self) -> tuple[FullSight, FullSight] | None:
        """Places of full sight in source and target that stand for viewpoints, if any do."""
        return self.judge.sights

    def compare(self, poses: list[ScoredPose]) -> list[ScoredPose]:
        """Add to the evidence of each pose how it compares with the others."""
        return self._with_only_complete(with_contrast(self.judge.with_layer_support(poses)))

    def _with_only_complete(self, poses: list[ScoredPose]) -> list[ScoredPose]:
        """Mark the pose that alone explains every point of both clouds."""
        if self._size_ratio > MAX_CALIBRATED_SIZE_RATIO:
            return poses
        ordered = sorted(poses, key=lambda pose: pose.evidence.on_surface_fraction, reverse=True)
        distinct = select_distinct(ordered)
        row = self._find_only_complete(distinct)
        if row is not None:  # others may slide until they explain as much
            row = self._find_only_complete([self._settle(pose) for pose in distinct])
        if row is None:
            return poses
        return [beside_only_complete(pose, distinct[row]) for pose in poses]

    def _find_only_complete(self, distinct: list[ScoredPose]) -> int | None:
        return self._completeness.find_only(
            [pose.minimum.T for pose in distinct], [pose.evidence for pose in distinct]
        )

    @cached_property
    def _completeness(self) -> Completeness:
        return Completeness(self.source.fine, self.target.fine, self._regime)


def _is_sure(poses: list[ScoredPose]) -> bool:
    """Whether one of the poses needs no more rivals."""
    return any(pose.evidence.confidence >= UNRIVALLED_CONFIDENCE for pose in poses)


def _moved(pose: ScoredPose, minimum: Minimum) -> ScoredPose:
    """Return the pose at a minimum near it; the pose itself if the minimum is another one."""
    return replace(pose, minimum=minimum) if are_close(minimum.T, pose.minimum.T) else pose


def choose_planes(
    source: PreparedCloud,
    target: PreparedCloud,
    prior: PosePrior,
    regime: Regime,
    options: RegistrationOptions,
) -> PlaneRefiner:
    """Point-to-plane on the planes of the target, or of the source where these are better."""
    if regime.takes_planes_of_source:
        basis = prior.inverse().motion_basis()
        return SwappedPointToPlane(PointToPlane(target, source, basis, regime, options))
    return PointToPlane(source, target, prior.motion_basis(), regime, options)
