"""Registration of a source cloud onto a target cloud, step by step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpe_core.assess.coincidence import (
    CoincidenceEvidence,
    are_scattered,
    doubt,
    find_coincidences,
)
from mpe_core.assess.energy import p2_energy
from mpe_core.assess.inliers import estimate_inlier_threshold, find_inliers
from mpe_core.assess.warnings import describe_warnings
from mpe_core.clouds.normalize import CloudPair, normalize_pair
from mpe_core.clouds.preprocess import prepare_clouds
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.nearest import nearest_rows
from mpe_core.geometry.rigid import apply
from mpe_core.options import RegistrationOptions
from mpe_core.paper.methods import run_paper_method
from mpe_core.pipeline import PosePipeline, ScoredPose, select_distinct
from mpe_core.progress import Progress, StageCallback
from mpe_core.refine.covariance import PoseUncertainty, paired_points_uncertainty
from mpe_core.refine.minimum import Minimum
from mpe_core.result import Registration
from mpe_core.search.pose_prior import PosePrior

ENERGY_EPS = 0.03
"""eps of the reported P2 energy, in radii of the smaller cloud."""


def register(
    source: ArrayLike,
    target: ArrayLike,
    options: RegistrationOptions | None = None,
    *,
    source_weights: ArrayLike | None = None,
    target_weights: ArrayLike | None = None,
    on_progress: StageCallback | None = None,
) -> Registration:
    """Find the rigid pose that lays the source on the target.

    The input is never changed. Rows with NaN or infinity are ignored, and those that stand for no
    point: (0, 0, 0) or -9999 without a measurement, echoes at the largest range, copies. The same
    input, options and seed give the same bits, on any number of threads.

    Parameters
    ----------
    source, target
        (N, 3) and (M, 3) points, in one unit of length.
    options
        Options of the registration; None for the defaults.
    source_weights, target_weights
        (N,) and (M,) weights of the points, 0 or more and in any unit: K_i of the paper. Points of
        weight 0 do not influence the pose, but may be inliers.
    on_progress
        Called as on_progress(stage, fraction of the whole in [0, 1]) between stages and between the
        iterations of long ones. An exception that it raises ends the registration.

    Returns
    -------
    Registration
        The pose, and how far to trust it.

    Raises
    ------
    InvalidCloudError
        If a cloud is not an (N, 3) array of at least 3 finite points that span a plane, or its
        weights do not fit.
    InvalidOptionsError
        If an option cannot go with these clouds.

    Examples
    --------
    A wavy sheet, turned by 37 degrees about z and shifted:

    >>> import numpy as np
    >>> from mpe_core import register
    >>> x, y = np.random.default_rng(0).uniform(-1, 1, (2, 5000))
    >>> target = np.column_stack([x, y, 0.3 * np.sin(3 * x + y) + 0.1 * x * y])
    >>> R = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    >>> source = (target - [5, 0, 2]) @ R  # so that target = R source + (5, 0, 2)
    >>> result = register(source, target)
    >>> result.accepted
    True
    >>> bool(np.allclose(result.T_target_source[:3, :3], R, atol=1e-3))
    True
    >>> result.T_target_source[:3, 3].round(2) + 0.0
    array([5., 0., 2.])
    """
    options, progress = options or RegistrationOptions(), Progress(on_progress)
    with progress.stage("prepare") as report:
        pair = normalize_pair(
            validate_cloud(
                source,
                "source",
                source_weights,
                keep_no_data=options.keep_no_data,
                viewpoint=options.source_viewpoint,
            ),
            validate_cloud(
                target,
                "target",
                target_weights,
                keep_no_data=options.keep_no_data,
                viewpoint=options.target_viewpoint,
            ),
        )
        report(0.3)
        clouds = prepare_clouds(pair, options)
        report(0.8)
        prior = PosePrior.from_options(options, pair)
        pipeline = PosePipeline(*clouds, prior, options, pair.size_ratio)
    best, *others = _find_poses(pipeline, pair, options, progress)
    minimum = best.minimum
    with progress.stage("refine"):
        uncertainty = _estimate_uncertainty(pipeline, pair, best)
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
        confidence=best.evidence.confidence,
        accepted=best.evidence.accepted,
        ambiguous=len(others) > 0,
        alternatives=_in_caller_frames(pair, others),
        covariance=uncertainty.covariance,
        free_directions=uncertainty.degenerate_directions,
        warnings=(),
        timing=progress.finish(),
    )
    return replace(result, warnings=describe_warnings(pair, best.evidence, result))


def _find_poses(
    pipeline: PosePipeline, pair: CloudPair, options: RegistrationOptions, progress: Progress
) -> list[ScoredPose]:
    """Best pose by the chosen method, followed by those that fit as well."""
    if options.method == "mpl" and options.search == "global":
        return _find_by_search(pipeline, pair, options, progress)
    minimum = run_paper_method(pair, options, progress)
    return [ScoredPose(minimum, pipeline.scorer.score(minimum.T))]


def _find_by_search(
    pipeline: PosePipeline, pair: CloudPair, options: RegistrationOptions, progress: Progress
) -> list[ScoredPose]:
    """Poses of few points that correspond one by one, or else of the search."""
    source = pair.source_cloud.weighted(pair.source)
    target = pair.target_cloud.weighted(pair.target)
    coincidences = find_coincidences(source, target, options.seed)
    if coincidences is None:
        return pipeline.run(progress)
    poses = np.array([T for T, _ in coincidences]).reshape(-1, 4, 4)
    certain = [
        ScoredPose(Minimum(T, converged=True, iterations=1), evidence)
        for (T, evidence), is_allowed in zip(coincidences, pipeline.allows(poses), strict=True)
        if is_allowed and evidence.accepted
    ]
    if certain:
        return select_distinct(certain)
    found = pipeline.run(progress)
    if not (are_scattered(source) and are_scattered(target)):
        return found
    alarms = min((evidence.log_false_alarms for _, evidence in coincidences), default=0.0)
    return [replace(found[0], evidence=doubt(found[0].evidence, max(alarms, 0.0)))]


def _estimate_uncertainty(
    pipeline: PosePipeline, pair: CloudPair, pose: ScoredPose
) -> PoseUncertainty:
    evidence, T = pose.evidence, pose.minimum.T
    if not (isinstance(evidence, CoincidenceEvidence) and evidence.accepted):
        return pipeline.refiner.uncertainty(pose.minimum)
    moved = apply(T, pair.source)
    distances = np.linalg.norm(
        moved - pair.target[nearest_rows(moved, pair.target, np.inf)], axis=1
    )
    near = distances <= evidence.reach
    return paired_points_uncertainty(moved[near], distances[near])


def _in_caller_frames(pair: CloudPair, poses: list[ScoredPose]) -> NDArray[np.float64]:
    """(K, 4, 4) poses between the caller's clouds."""
    return np.array([pair.to_caller(pose.minimum.T) for pose in poses]).reshape(-1, 4, 4)
