"""register(): a source cloud onto a target cloud, step by step."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpe_core.assess.confidence import Evidence
from mpe_core.assess.covariance import PoseUncertainty
from mpe_core.assess.energy import p2_energy
from mpe_core.assess.inliers import inlier_threshold
from mpe_core.clouds.normalize import Cloud, CloudPair, as_pair, as_points, radius
from mpe_core.clouds.preprocess import PreparedCloud, scan
from mpe_core.clouds.surface import VOXEL
from mpe_core.clouds.unit_check import unit_mismatch
from mpe_core.errors import InvalidOptionsError
from mpe_core.evaluator import PoseEvaluator, ScoredPose
from mpe_core.geometry.nearest import nearest_rows
from mpe_core.geometry.rigid import apply
from mpe_core.kernels.point_rows import correspondence_distances
from mpe_core.options import RegistrationOptions
from mpe_core.paper.methods import run_paper_method
from mpe_core.pipeline import align
from mpe_core.progress import Progress, Report
from mpe_core.refine.minimum import Minimum
from mpe_core.result import Inliers, Registration
from mpe_core.search.pose_prior import PosePrior

LEAST_VOXEL, MOST_VOXEL = 1e-3, 0.2
"""Finest and coarsest thinning, in radii of the smaller cloud; a sphere of radius 1 keeps some 300
points with the coarsest, and 12 million with the finest."""

ENERGY_EPS = 0.03
"""eps of the reported P2 energy, in radii of the smaller cloud."""


def register(
    source: ArrayLike,
    target: ArrayLike,
    options: RegistrationOptions | None = None,
    *,
    source_weights: ArrayLike | None = None,
    target_weights: ArrayLike | None = None,
    on_progress: Report | None = None,
) -> Registration:
    """Rigid pose that lays the source (N, 3) on the target (M, 3).

    source_weights (N,) and target_weights (M,), 0 or more, in any unit: how much each point counts
    (K_i of the paper). Points of weight 0 have no say in the pose, but may be inliers.

    on_progress(stage, fraction of the whole in [0, 1]) is called between stages and between the
    iterations of long ones; what it raises ends the registration. The input is never changed, rows
    with NaN or infinity are left out, and the same input, options and seed give the same bits.

    Raises
    ------
    InvalidCloudError
        A cloud is not an (N, 3) array of at least 3 finite points that span a plane, or its weights
        do not fit.
    InvalidOptionsError
        Options that cannot go with these clouds.
    """
    options, progress = options or RegistrationOptions(), Progress(on_progress)
    with progress.stage("prepare") as report:
        x = as_points(source, "source", source_weights)
        y = as_points(target, "target", target_weights)
        pair = as_pair(x, y)
        report(0.3)
        scans = _scans(x, y, pair, options)
        report(0.8)
        alignment = PoseEvaluator(*scans, PosePrior.of(options, pair), options, pair.larger)
    best, *others = _aligned(alignment, x, y, pair, options, progress)
    polished, trust = best.polished, best.evidence
    with progress.stage("refine"):
        known = alignment.uncertainty(polished).in_unit(pair.unit)
    with progress.stage("inliers"):
        distance = alignment.distances(polished.T)
        threshold = inlier_threshold(distance, options.overlap, alignment.spacing()) * pair.unit
        inliers = _inliers(x, y, pair, polished.T, options.inlier_threshold or threshold)
    return Registration(
        T_target_source=pair.to_caller(polished.T),
        inliers=inliers,
        overlap=len(inliers) / len(x.points),
        rmse=float(np.sqrt(np.mean(inliers.distance**2))) if len(inliers) else 0.0,
        energy=p2_energy(distance, ENERGY_EPS),
        converged=polished.converged,
        iterations=polished.iterations,
        confidence=trust.confidence,
        accepted=trust.accepted,
        ambiguous=len(others) > 0,
        alternatives=_in_caller_frames(pair, others),
        covariance=known.covariance,
        free_directions=known.free,
        warnings=_warnings(x, y, pair, polished, len(inliers), trust, len(others), known),
        timing=progress.finish(),
    )


def _scans(
    x: Cloud, y: Cloud, pair: CloudPair, options: RegistrationOptions
) -> tuple[PreparedCloud, PreparedCloud]:
    """Both clouds thinned, without the points of weight 0."""
    voxel = VOXEL if options.voxel_size is None else options.voxel_size / pair.unit
    if not LEAST_VOXEL <= voxel <= MOST_VOXEL:
        raise InvalidOptionsError(
            "voxel_size must be at most a fifth and at least a thousandth of the radius"
            f" {pair.unit:.6g} of the smaller cloud, got {options.voxel_size}"
        )
    views = pair.viewpoints(options.source_viewpoint, options.target_viewpoint)
    found = [
        scan(
            cloud.heavy(points),
            voxel,
            None if cloud.weights is None else cloud.heavy(cloud.weights),
            viewpoint,
        )
        for cloud, points, viewpoint in zip((x, y), (pair.source, pair.target), views, strict=True)
    ]
    return found[0], found[1]


def _aligned(
    alignment: PoseEvaluator,
    x: Cloud,
    y: Cloud,
    pair: CloudPair,
    options: RegistrationOptions,
    progress: Progress,
) -> list[ScoredPose]:
    """The pose, then those that fit as well."""
    if options.method == "mpl" and options.search == "global":
        return align(alignment, progress)
    printed = run_paper_method(x, y, pair, options, progress)
    return [ScoredPose(printed, alignment.judge(printed.T))]


def _in_caller_frames(pair: CloudPair, found: list[ScoredPose]) -> NDArray[np.float64]:
    """(K, 4, 4) the poses between the caller's clouds."""
    return np.array([pair.to_caller(pose.polished.T) for pose in found]).reshape(-1, 4, 4)


def _inliers(
    source: Cloud, target: Cloud, pair: CloudPair, T: NDArray[np.float64], threshold: float
) -> Inliers:
    """Source points whose nearest target point is within the threshold (caller's unit)."""
    moved = apply(T, pair.source)
    row = nearest_rows(moved, pair.target, threshold / pair.unit)
    distance = np.empty(len(moved))
    correspondence_distances(moved, pair.target, row, pair.unit, distance)
    close = np.flatnonzero(distance <= threshold)
    return Inliers(source.given(close), target.given(row[close]), distance[close], threshold)


def _warnings(
    source: Cloud,
    target: Cloud,
    pair: CloudPair,
    polished: Minimum,
    inliers: int,
    trust: Evidence,
    rivals: int,
    known: PoseUncertainty,
) -> tuple[str, ...]:
    texts = [
        f"{cloud.dropped} rows of the {name} were left out: NaN or infinity"
        for name, cloud in (("source", source), ("target", target))
        if cloud.dropped
    ]
    if not polished.converged:
        texts.append(f"not converged after {polished.iterations} iterations")
    if not trust.accepted:
        texts.append(
            f"do not trust this pose: {trust.near:.0%} of the points come near the target, and of"
            f" those that tell {trust.sharp:.0%} more than by chance lie on its surface; the clouds"
            " may overlap too little, or show different things"
        )
        mismatch = unit_mismatch(
            radius(source.heavy(source.points), pair.source_centre),
            radius(target.heavy(target.points), pair.target_centre),
        )
        texts += [mismatch] if mismatch else []
    if rivals:
        texts.append(
            f"{rivals} other poses fit as well (alternatives): the shape is symmetric or slides on"
            " itself"
        )
    if len(known.free):
        texts.append(
            f"the surfaces slide on themselves in {len(known.free)} of 6 directions"
            " (free_directions): the pose is not told along them"
        )
    if not inliers:
        texts.append("no source point is within the inlier threshold of the target")
    return tuple(texts)
