"""Registration of two checked clouds at one scale, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.assess.coincidence import (
    CoincidenceEvidence,
    are_scattered,
    doubt,
    find_coincidences,
)
from mpe_core.assess.confidence import DOUBTED_CONFIDENCE
from mpe_core.assess.energy import p2_energy
from mpe_core.assess.inliers import estimate_inlier_threshold, find_inliers
from mpe_core.assess.outline import keep_level, turn_outline, weigh_outline
from mpe_core.assess.rivals import AMBIGUOUS_CONFIDENCE, ScoredPose, select_distinct
from mpe_core.assess.volume import doubt_fit_everywhere, find_exact_pose, may_fill_volume
from mpe_core.assess.warnings import describe_warnings
from mpe_core.clouds.flat import Plane, draw_outline, find_plane, lay_flat
from mpe_core.clouds.near_part import (
    find_near_radius,
    keep_near_part,
    scanner_place,
    shows_surface_within,
)
from mpe_core.clouds.normalize import CloudPair, normalize_pair
from mpe_core.clouds.preprocess import PreparedCloud, prepare_clouds
from mpe_core.clouds.validate import Cloud, validate_cloud
from mpe_core.exchanged_pipeline import ExchangedPipeline, Pipeline
from mpe_core.geometry.nearest import nearest_rows
from mpe_core.geometry.rigid import apply, inverse
from mpe_core.options import RegistrationOptions
from mpe_core.paper.methods import run_paper_method
from mpe_core.pipeline import PosePipeline, choose_planes
from mpe_core.progress import Progress
from mpe_core.refine.covariance import PoseUncertainty, paired_points_uncertainty
from mpe_core.refine.minimum import Minimum
from mpe_core.refine.regime import choose_regime
from mpe_core.result import Registration
from mpe_core.search.pose_prior import PosePrior
from mpe_core.search.pose_search import SEARCH_LEVELS, SearchLevel

ENERGY_EPS = 0.03
"""eps of the reported P2 energy, in radii of the smaller cloud."""


SLIDES_OF_PLANE = 2
"""Independent slides from which on a pose is not accepted: what both clouds show is one plane."""

MIN_EXCHANGE_RATIO = 1.2
"""Radius of the source over that of the target from which on the target is moved in its place
(docs/tuning.md)."""


@dataclass(frozen=True, slots=True)
class Trial:
    """Best pose between two clouds, with what found it."""

    best: ScoredPose
    """Pose and evidence, between the normalized clouds."""
    pipeline: Pipeline
    """What matched the clouds."""
    pair: CloudPair
    """The normalized clouds."""

    @property
    def T_target_source(self) -> NDArray[np.float64]:
        """(4, 4) pose between the caller's clouds."""
        return self.pair.to_caller(self.best.minimum.T)


@dataclass(frozen=True, slots=True)
class Attempt(Trial):
    """Registration at one scale, with what found it."""

    found: Registration
    """Result, whose transform is rigid."""
    is_on_plane: bool
    """Whether the clouds fit, but are refused since what both show is one plane."""
    is_by_color: bool = False
    """Whether intensity or colour settled the pose."""


def register_rigidly(
    source: Cloud,
    target: Cloud,
    options: RegistrationOptions,
    progress: Progress,
    *,
    levels: Sequence[SearchLevel] = SEARCH_LEVELS,
    start: NDArray[np.float64] | None = None,
    compares_shape: bool = True,
) -> Attempt:
    """Find the rigid pose that lays the source on the target.

    Parameters
    ----------
    source, target
        Checked clouds.
    options
        Options of the registration; `scale` is not read.
    progress
        Takes stages and times.
    levels
        Levels of the search.
    start
        (4, 4) pose between the caller's clouds, to be refined without a search.
    compares_shape
        Whether points have to meet points of the same local shape.
    """
    pair, pipeline = _prepare(source, target, options, progress, compares_shape=compares_shape)
    if start is None:
        best, *others = _find_poses(pipeline, pair, options, progress, levels)
    else:
        best, others = pipeline.finish(pipeline.refine(pair.from_caller(start))), []
    with progress.stage("refine"):
        uncertainty = _estimate_uncertainty(pipeline, pair, best)
    return describe_pose(pipeline, pair, [best, *others], uncertainty, options, progress)


def search_trial(
    source: Cloud,
    target: Cloud,
    options: RegistrationOptions,
    progress: Progress,
    levels: Sequence[SearchLevel],
) -> Trial:
    """Find the best rigid pose, neither brought to its exact end nor described."""
    pair, pipeline = _prepare(source, target, options, progress, trial_score=-np.inf)
    best = _find_poses(pipeline, pair, options, progress, levels)[0]
    return Trial(best, pipeline, pair)


def search_mirrored(
    trial: Trial,
    options: RegistrationOptions,
    progress: Progress,
    levels: Sequence[SearchLevel],
    least_score: float = -np.inf,
) -> Trial:
    """Find the best pose, as `search_trial` does, with the x of a trial's source turned to -x.

    Parameters
    ----------
    trial
        What prepared the clouds.
    options
        Options of the registration, with the gravity of the mirrored source.
    progress
        Takes stages and times.
    levels
        Levels of the search.
    least_score
        Score by itself from which on a pose is of use.
    """
    pair = trial.pair.with_mirrored_source()
    source, target = trial.pipeline.clouds
    pipeline = _choose_pipeline(
        pair, (source.mirrored(), target), options, compares_shape=True, trial_score=least_score
    )
    best = _find_poses(pipeline, pair, options, progress, levels)[0]
    return Trial(best, pipeline, pair)


def _prepare(
    source: Cloud,
    target: Cloud,
    options: RegistrationOptions,
    progress: Progress,
    *,
    compares_shape: bool = True,
    trial_score: float | None = None,
) -> tuple[CloudPair, Pipeline]:
    """Normalize the clouds, and choose what matches them."""
    with progress.stage("prepare") as report:
        report(0.2)
        pair, clouds = prepare_pair(source, target, options)
        report(0.8)
        return pair, _choose_pipeline(
            pair, clouds, options, compares_shape=compares_shape, trial_score=trial_score
        )


def _choose_pipeline(
    pair: CloudPair,
    clouds: tuple[PreparedCloud, PreparedCloud],
    options: RegistrationOptions,
    *,
    compares_shape: bool,
    trial_score: float | None,
) -> Pipeline:
    """Pipeline that moves the source, or the target where the source is the larger cloud."""
    source, target = clouds
    prior = PosePrior.from_options(options, pair)
    larger = np.divide(*pair.radii)
    if larger < MIN_EXCHANGE_RATIO or options.initial_transform or options.overlap:
        return PosePipeline(
            source,
            target,
            prior,
            options,
            pair.size_ratio,
            compares_shape=compares_shape,
            trial_score=trial_score,
        )
    inner = PosePipeline(
        target,
        source,
        prior.inverse(),
        options,
        pair.size_ratio,
        compares_shape=compares_shape,
        trial_score=trial_score,
    )
    planes = choose_planes(source, target, prior, choose_regime(source, target), options)
    return ExchangedPipeline(inner, planes)


def describe_pose(
    pipeline: Pipeline,
    pair: CloudPair,
    poses: list[ScoredPose],
    uncertainty: PoseUncertainty,
    options: RegistrationOptions,
    progress: Progress,
) -> Attempt:
    """Describe the first of the poses in the caller's frames, and the others as alternatives.

    Parameters
    ----------
    pipeline, pair
        What matched the clouds, and the normalized clouds.
    poses
        Poses between the normalized clouds.
    uncertainty
        That of the first pose, about the target's origin.
    options
        Options of the registration.
    progress
        Takes stages and times.
    """
    best, *others = poses
    minimum, evidence = best.minimum, best.evidence
    is_on_plane = evidence.fits and uncertainty.slides >= SLIDES_OF_PLANE
    largest = DOUBTED_CONFIDENCE if is_on_plane else AMBIGUOUS_CONFIDENCE if others else 1.0
    # about the moved source's centroid, which is the origin of the normalized source
    uncertainty = uncertainty.with_origin(minimum.T[:3, 3]).in_unit(pair.unit)
    with progress.stage("inliers"):
        distances = pipeline.planes.match(minimum.T).distances()
        estimate = estimate_inlier_threshold(
            distances, options.overlap, pipeline.planes.point_spacing()
        )
        inliers = find_inliers(pair, minimum.T, options.inlier_threshold or estimate * pair.unit)
    result = Registration(
        T_target_source=pair.to_caller(minimum.T),
        inliers=inliers,
        overlap=len(inliers) / len(pair.source),
        rmse=inliers.rmse(),
        energy=p2_energy(distances, ENERGY_EPS),
        converged=minimum.converged,
        iterations=minimum.iterations,
        confidence=min(evidence.confidence, largest),
        accepted=evidence.accepted and not is_on_plane,
        ambiguous=len(others) > 0,
        alternatives=_in_caller_frames(pair, others),
        covariance=uncertainty.covariance,
        free_directions=uncertainty.degenerate_directions,
        warnings=(),
        scale=1.0,
        timing=progress.finish(),
    )
    warnings = describe_warnings(pair, evidence, result, pipeline.sights, is_on_plane=is_on_plane)
    return Attempt(best, pipeline, pair, replace(result, warnings=warnings), is_on_plane)


def prepare_pair(
    source: Cloud, target: Cloud, options: RegistrationOptions
) -> tuple[CloudPair, tuple[PreparedCloud, PreparedCloud]]:
    """Normalize and thin both clouds; of long narrow ones the part around the scanner."""
    pair = normalize_pair(source, target)
    clouds = prepare_clouds(pair, options)
    if not (pair.is_uneven or choose_regime(*clouds).is_noisy):
        return pair, clouds
    near = _keep_near_parts(pair, options)
    return (pair, clouds) if near is pair else (near, prepare_clouds(near, options))


def _keep_near_parts(pair: CloudPair, options: RegistrationOptions) -> CloudPair:
    """Return the pair without the far parts of long narrow clouds, or the same pair."""
    viewpoints = options.source_viewpoint, options.target_viewpoint
    clouds = [
        (cloud, scanner_place(cloud, places))
        for cloud, places in zip((pair.source_cloud, pair.target_cloud), viewpoints, strict=True)
    ]
    found = [
        find_near_radius(cloud, radius, centre)
        for (cloud, centre), radius in zip(clouds, pair.radii, strict=True)
    ]
    reach = min((radius for radius in found if radius is not None), default=None)
    if reach is None or not all(shows_surface_within(cloud, reach, at) for cloud, at in clouds):
        return pair
    source, target = (keep_near_part(cloud, reach, at) for cloud, at in clouds)
    return normalize_pair(source, target)


def _find_poses(
    pipeline: Pipeline,
    pair: CloudPair,
    options: RegistrationOptions,
    progress: Progress,
    levels: Sequence[SearchLevel],
) -> list[ScoredPose]:
    """Best pose by the chosen method, followed by those that fit as well."""
    if options.is_global:
        return _find_by_search(pipeline, pair, options, progress, levels)
    minimum = run_paper_method(pair, options, progress)
    return [ScoredPose(minimum, pipeline.score(minimum.T))]


def _find_by_search(
    pipeline: Pipeline,
    pair: CloudPair,
    options: RegistrationOptions,
    progress: Progress,
    levels: Sequence[SearchLevel],
) -> list[ScoredPose]:
    """Poses of few points that correspond one by one, or else of the search."""
    source = pair.source_cloud.weighted(pair.source)
    target = pair.target_cloud.weighted(pair.target)
    planes = _find_planes(source, target)
    coincidences = find_coincidences(source, target, options.seed)
    if planes is not None:
        coincidences = keep_level(coincidences or [], *planes)
    if coincidences is None:
        return _find_among_many(pipeline, (source, target), options, progress, levels)
    poses = np.array([T for T, _ in coincidences]).reshape(-1, 4, 4)
    certain = [
        ScoredPose(Minimum(T, converged=True, iterations=1), evidence)
        for (T, evidence), is_allowed in zip(coincidences, pipeline.allows(poses), strict=True)
        if is_allowed and evidence.accepted
    ]
    if certain:
        return select_distinct(certain)
    if planes is not None:
        return _find_flat((source, target), planes, options, progress)
    found = pipeline.run(progress, levels)
    if not (are_scattered(source) and are_scattered(target)):
        return found
    alarms = min((evidence.log_false_alarms for _, evidence in coincidences), default=0.0)
    return [replace(found[0], evidence=doubt(found[0].evidence, max(alarms, 0.0)))]


def _find_among_many(
    pipeline: Pipeline,
    points: tuple[NDArray[np.float64], NDArray[np.float64]],
    options: RegistrationOptions,
    progress: Progress,
    levels: Sequence[SearchLevel],
) -> list[ScoredPose]:
    """Poses of many points: of surfaces by the search; of volumes one by one, or else in doubt."""
    if not (pipeline.has_noise and all(map(may_fill_volume, pipeline.coarse_points()))):
        return pipeline.run(progress, levels)
    exact = find_exact_pose(*points, options.seed)
    if exact is not None and pipeline.allows(exact[0][None])[0]:
        return [ScoredPose(Minimum(exact[0], converged=True, iterations=1), exact[1])]
    found = pipeline.run(progress, levels)
    best, T = found[0], found[0].minimum.T
    # the normalized source is centred on its centre of mass
    evidence = doubt_fit_everywhere(best.evidence, T, T[:3, 3], pipeline.score)
    return found if evidence is best.evidence else [replace(best, evidence=evidence)]


def _find_planes(
    source: NDArray[np.float64], target: NDArray[np.float64]
) -> tuple[Plane, Plane] | None:
    """Find the planes of both clouds; None unless both are flat."""
    x, y = find_plane(source), find_plane(target)
    return None if x is None or y is None else (x, y)


def _find_flat(
    points: tuple[NDArray[np.float64], NDArray[np.float64]],
    planes: tuple[Plane, Plane],
    options: RegistrationOptions,
    progress: Progress,
) -> list[ScoredPose]:
    """Poses between flat clouds within their planes, by the walls over their outlines.

    The best one, followed by those at which the outlines lie on each other as well.
    """
    outlines = [draw_outline(each, plane) for each, plane in zip(points, planes, strict=True)]
    walls = [validate_cloud(outline.raise_walls(), "outline") for outline in outlines]
    is_level = planes[0].is_level and planes[1].is_level
    searched = RegistrationOptions(
        yaw_only=is_level, overlap=options.overlap, seed=options.seed, infer_viewpoints="never"
    )
    # what the walls' surface is like comes from the spacing of the points
    attempt = register_rigidly(walls[0], walls[1], searched, progress, compares_shape=False)

    def laid_flat(wall_pose: NDArray[np.float64]) -> ScoredPose:
        T = lay_flat(wall_pose)
        evidence = weigh_outline(attempt.best.evidence, T, *outlines)
        lifted = inverse(planes[1].T) @ T @ planes[0].T
        return ScoredPose(replace(attempt.best.minimum, T=lifted), evidence)

    best = laid_flat(attempt.found.T_target_source)
    if not best.evidence.accepted:
        return [best]
    starts = map(attempt.pair.from_caller, turn_outline(outlines[0], attempt.found.T_target_source))
    turned = [attempt.pair.to_caller(attempt.pipeline.refine(T).minimum.T) for T in starts]
    others = map(laid_flat, (*attempt.found.alternatives, *turned))
    return select_distinct([best, *(each for each in others if each.evidence.accepted)])


def _estimate_uncertainty(pipeline: Pipeline, pair: CloudPair, pose: ScoredPose) -> PoseUncertainty:
    evidence, T = pose.evidence, pose.minimum.T
    if not (isinstance(evidence, CoincidenceEvidence) and evidence.accepted):
        return pipeline.uncertainty(pose.minimum)
    moved = apply(T, pair.source)
    distances = np.linalg.norm(
        moved - pair.target[nearest_rows(moved, pair.target, np.inf)], axis=1
    )
    near = distances <= evidence.reach
    return paired_points_uncertainty(moved[near], distances[near])


def _in_caller_frames(pair: CloudPair, poses: list[ScoredPose]) -> NDArray[np.float64]:
    """(K, 4, 4) poses between the caller's clouds."""
    return np.array([pair.to_caller(pose.minimum.T) for pose in poses]).reshape(-1, 4, 4)
