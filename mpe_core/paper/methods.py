"""The paper's methods as it prints them: local, with a wide basin."""

from __future__ import annotations

import numpy as np

from mpe_core.clouds.normalize import Cloud, CloudPair
from mpe_core.geometry.nearest import NearestNeighbors
from mpe_core.geometry.rigid import apply
from mpe_core.options import RegistrationOptions
from mpe_core.paper.algorithm1 import EPS, Descent, descend
from mpe_core.paper.barnes_hut_tree import tree_order
from mpe_core.paper.force_field import Array, ExactField, Field, TreeField
from mpe_core.paper.sparse_search import sparse_mpe
from mpe_core.paper.trimmed_icp import trimmed_icp
from mpe_core.progress import Progress
from mpe_core.refine.minimum import Minimum

Weights = tuple[Array | None, Array | None]
"""(N,) of the source and (M,) of the target, where there are any."""


def run_paper_method(
    x: Cloud, y: Cloud, pair: CloudPair, options: RegistrationOptions, progress: Progress
) -> Minimum:
    """Method "mpe" on all points, or "mpl" with a sparse search and trimmed ICP; without the points
    of weight 0."""
    start = np.eye(4)
    if options.initial_transform is not None:
        start = pair.from_caller(np.array(options.initial_transform))
    source, target = apply(start, x.heavy(pair.source)), y.heavy(pair.target)
    method = _mpe if options.method == "mpe" else _mpl
    found = method(source, target, (x.masses(), y.masses()), options, progress)
    return Minimum(found.T_target_source @ start, found.converged, found.iterations, is_planar=True)


def _mpe(
    source: Array, target: Array, weights: Weights, options: RegistrationOptions, progress: Progress
) -> Descent:
    """Algorithm 1 on the source (N, 3) from where it lies."""
    K, masses = weights
    with progress.stage("search") as report:
        if options.field == "exact":
            field: Field = ExactField(target, EPS, masses)
        else:
            field, order = TreeField(target, EPS, masses), tree_order(source)
            source, K = source[order], None if K is None else K[order]
        return descend(source, field, options.max_iterations, report, K)


def _mpl(
    source: Array, target: Array, weights: Weights, options: RegistrationOptions, progress: Progress
) -> Descent:
    """Algorithm 1 on a sample of each cloud, then trimmed ICP on all points."""
    most, size, seed = options.max_iterations, options.sample_size, options.seed
    with progress.stage("search") as report:
        T = sparse_mpe(source, target, size, most, seed, report, *weights).T_target_source
    with progress.stage("refine") as report:
        return trimmed_icp(
            source, NearestNeighbors(target), T, options.overlap, most, report, *weights
        )
