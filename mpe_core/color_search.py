"""Intensity or colour settles what the surfaces leave free: a slide along a wall, a turn of a tube.

The pattern is raised to a relief, which is registered as any other shape. Across the surfaces the
pose is that of the surfaces themselves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mpe_core.assess.coincidence import CoincidenceEvidence
from mpe_core.assess.rivals import AMBIGUOUS_CONFIDENCE, ScoredPose
from mpe_core.assess.warnings import describe_warnings
from mpe_core.clouds.relief import Painted, find_pattern
from mpe_core.clouds.validate import Cloud, validate_cloud
from mpe_core.geometry.rigid import pose
from mpe_core.kernels.rigid_motion import update_pose
from mpe_core.options import RegistrationOptions
from mpe_core.progress import Progress
from mpe_core.refine.minimum import Minimum
from mpe_core.result import CodedWarning, Registration
from mpe_core.rigid_registration import Attempt, describe_pose, register_rigidly
from mpe_core.search.pose_search import SEARCH_LEVELS

Array = NDArray[np.float64]

LEVELS = SEARCH_LEVELS[:2]
"""Levels of the search over reliefs; the first alone misses some tubes."""

SETTLED = CodedWarning(
    "settled_by_color",
    "the surfaces alone do not determine the pose: the pattern of intensity or colour settles it;"
    ' set use_color to "never" to do without',
)
"""What is said of a pose that colour settled."""


def settle_by_color(first: Attempt, options: RegistrationOptions, progress: Progress) -> Attempt:
    """Settle by intensity or colour what the surfaces leave free, where both clouds have it.

    Parameters
    ----------
    first
        Registration by the surfaces.
    options
        Options of the registration.
    progress
        Takes stages and times.

    Returns
    -------
    Attempt
        The given one where the surfaces settle the pose, or the patterns do not match.
    """
    painted = _find_patterns(first, options)
    if painted is None:
        return first
    sides = (1, -1) if any(each.axis is not None for each in painted) else (1,)
    source, target = painted
    fixed = _to_cloud(target.raise_relief(1), first, "target")
    # no beam met what brightness raises
    searched = replace(options, voxel_size=None, infer_viewpoints="never")
    tried = [
        register_rigidly(
            _to_cloud(source.raise_relief(side), first, "source"),
            fixed,
            searched,
            progress,
            levels=LEVELS,
        )
        for side in sides
    ]
    accepted = sorted(
        (each for each in tried if each.found.accepted),
        key=lambda each: each.best.evidence.sort_key,
        reverse=True,
    )
    return _combine(first, accepted, options, progress) if accepted else first


def _find_patterns(first: Attempt, options: RegistrationOptions) -> tuple[Painted, Painted] | None:
    """Find the patterns of both clouds; None unless they are needed and there."""
    found, pair = first.found, first.pair
    is_told = isinstance(first.best.evidence, CoincidenceEvidence) and found.accepted
    is_settled = is_told or not (len(found.free_directions) or found.ambiguous)
    if options.use_color == "never" or is_settled:
        return None
    patterns = [
        None
        if cloud.brightness is None
        else find_pattern(cloud.weighted(points), cloud.weighted(cloud.brightness))
        for cloud, points in ((pair.source_cloud, pair.source), (pair.target_cloud, pair.target))
    ]
    source, target = patterns
    return None if source is None or target is None else (source, target)


def _to_cloud(points: Array, first: Attempt, role: str) -> Cloud:
    """Return normalized points (N, 3) as a cloud in the caller's frame."""
    pair = first.pair
    centre = pair.source_centre if role == "source" else pair.target_centre
    return validate_cloud(points * pair.unit + centre, role)


def _combine(
    first: Attempt, reliefs: list[Attempt], options: RegistrationOptions, progress: Progress
) -> Attempt:
    """Take the free motions from the best relief, and the others from the surfaces next to it."""
    best, *others = (each.found for each in reliefs)
    pair, pipeline = first.pair, first.pipeline
    with progress.stage("refine"):
        start = pair.from_caller(best.T_target_source)
        near = pipeline.refine(start)
        surfaces = pipeline.uncertainty(Minimum(start, True, 1))
        T = _move_across(start, near.minimum.T, surfaces.degenerate_directions)
        minimum = replace(near.minimum, T=T, converged=best.converged)
        uncertainty = pipeline.uncertainty(minimum)
    evidence = reliefs[0].best.evidence
    described = describe_pose(
        pipeline, pair, [ScoredPose(minimum, evidence)], uncertainty, options, progress
    )
    found = replace(
        described.found,
        ambiguous=best.ambiguous or len(others) > 0,
        alternatives=np.array(
            [*best.alternatives, *(each.T_target_source for each in others)]
        ).reshape(-1, 4, 4),
        covariance=_mix_covariances(described.found, best, pair.unit),
        free_directions=best.free_directions,
        confidence=min(best.confidence, AMBIGUOUS_CONFIDENCE) if others else best.confidence,
        accepted=best.accepted,
    )
    warnings = describe_warnings(pair, evidence, found, pipeline.sights)
    return replace(described, found=replace(found, warnings=warnings), is_by_color=True)


def _move_across(start: Array, refined: Array, free: Array) -> Array:
    """(4, 4) pose `refined`, but without what it moved `start` along the free motions (K, 6)."""
    R = refined[:3, :3] @ start[:3, :3].T
    turn = Rotation.from_matrix(R).as_rotvec()
    motion = np.concatenate([turn, refined[:3, 3] - R @ start[:3, 3]])
    basis = np.linalg.qr(free.T)[0]
    across = motion - basis @ (basis.T @ motion)
    T = start.copy()
    update_pose(T, across)
    return pose(T[:3, :3], T[:3, 3])


def _mix_covariances(surfaces: Registration, relief: Registration, unit: float) -> Array:
    """(6, 6) covariance of the surfaces, and along their free motions that of the relief."""
    size = np.repeat([1.0, unit], 3)
    if not len(surfaces.free_directions):
        return surfaces.covariance
    basis = np.linalg.qr((surfaces.free_directions / size).T)[0]
    along = basis @ basis.T
    across = np.eye(6) - along
    by_surfaces, by_relief = (each.covariance / np.outer(size, size) for each in (surfaces, relief))
    mixed = across @ by_surfaces @ across + along @ by_relief @ along
    return np.asarray(mixed * np.outer(size, size))
