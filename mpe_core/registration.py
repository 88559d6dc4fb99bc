"""register(): a source cloud onto a target cloud, step by step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpe_core.cloud import Cloud, Pair, as_pair, as_points
from mpe_core.confidence import confidence
from mpe_core.descent import EPS, Descent, descend
from mpe_core.inliers import inlier_threshold
from mpe_core.neighbours import Neighbours
from mpe_core.options import RegistrationOptions
from mpe_core.potential import ExactField, p2_energy
from mpe_core.progress import Progress, Report
from mpe_core.refinement import trimmed_icp
from mpe_core.result import Inliers, Registration
from mpe_core.rigid import apply
from mpe_core.sparse_search import sparse_mpe

ENERGY_EPS = 0.03
"""eps of the reported P2 energy, in radii of the smaller cloud."""


def register(
    source: ArrayLike,
    target: ArrayLike,
    options: RegistrationOptions | None = None,
    *,
    on_progress: Report | None = None,
) -> Registration:
    """Rigid pose that lays the source (N, 3) on the target (M, 3).

    on_progress(stage, fraction of the whole in [0, 1]) is called between stages and between the
    iterations of long ones; what it raises ends the registration. The input is never changed, rows
    with NaN or infinity are left out, and the same input, options and seed give the same bits.

    Raises
    ------
    InvalidCloudError
        A cloud is not an (N, 3) array of at least 3 finite points that span a plane.
    """
    options = options or RegistrationOptions()
    progress = Progress(on_progress)
    with progress.stage("prepare"):
        x, y = as_points(source, "source"), as_points(target, "target")
        pair = as_pair(x, y)
        neighbours = Neighbours(pair.target)
    with progress.stage("search") as report:
        found = _search(pair, options, report)
    with progress.stage("refine") as report:
        found = _refine(pair, neighbours, found, options, report)
    with progress.stage("inliers"):
        T = found.T_target_source
        distance, nearest = neighbours.nearest(apply(T, pair.source))
        spacing = neighbours.spacing()
        threshold = options.inlier_threshold or pair.unit * inlier_threshold(
            distance, options.overlap, spacing
        )
        inliers = _inliers(x, y, pair.unit * distance, nearest, threshold)
    return Registration(
        T_target_source=pair.to_caller(T),
        inliers=inliers,
        overlap=len(inliers) / len(x.points),
        rmse=float(np.sqrt(np.mean(inliers.distance**2))) if len(inliers) else 0.0,
        energy=p2_energy(distance, ENERGY_EPS),
        converged=found.converged,
        iterations=found.iterations,
        confidence=confidence(distance, spacing),
        warnings=_warnings(x, y, found, len(inliers)),
        timing=progress.finish(),
    )


def _search(pair: Pair, options: RegistrationOptions, report: Callable[[float], None]) -> Descent:
    if options.method == "mpe":
        return descend(pair.source, ExactField(pair.target, EPS), options.max_iterations, report)
    return sparse_mpe(
        pair.source,
        pair.target,
        options.sample_size,
        options.max_iterations,
        options.seed,
        report,
    )


def _refine(
    pair: Pair,
    neighbours: Neighbours,
    found: Descent,
    options: RegistrationOptions,
    report: Callable[[float], None],
) -> Descent:
    if options.method == "mpe":
        return found
    return trimmed_icp(
        pair.source,
        neighbours,
        found.T_target_source,
        options.overlap,
        options.max_iterations,
        report,
    )


def _inliers(
    source: Cloud,
    target: Cloud,
    distance: NDArray[np.float64],
    nearest: NDArray[np.int64],
    threshold: float,
) -> Inliers:
    close = np.flatnonzero(distance <= threshold)
    return Inliers(
        source=source.index[close],
        target=target.index[nearest[close]],
        distance=distance[close],
        threshold=threshold,
    )


def _warnings(source: Cloud, target: Cloud, found: Descent, inliers: int) -> tuple[str, ...]:
    texts = [
        f"{cloud.dropped} rows of the {name} were left out: NaN or infinity"
        for name, cloud in (("source", source), ("target", target))
        if cloud.dropped
    ]
    if not found.converged:
        texts.append(f"not converged after {found.iterations} iterations")
    if not inliers:
        texts.append("no source point is within the inlier threshold of the target")
    return tuple(texts)
