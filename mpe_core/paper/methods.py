"""Methods "mpe" and "mpl" as the paper prints them: local, with a wide basin of convergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpe_core.clouds.normalize import CloudPair
from mpe_core.geometry.nearest import NearestNeighbors
from mpe_core.geometry.rigid import apply
from mpe_core.options import RegistrationOptions
from mpe_core.paper.algorithm1 import SOFTENING, run_algorithm1
from mpe_core.paper.barnes_hut_tree import tree_order
from mpe_core.paper.force_field import Array, ExactField, TreeField
from mpe_core.paper.sparse_search import search_sparse
from mpe_core.paper.trimmed_icp import trimmed_icp
from mpe_core.progress import Progress
from mpe_core.refine.minimum import Minimum

Weights = tuple[Array | None, Array | None]
"""(N,) weights of the source and (M,) of the target; None where all are 1."""


def run_paper_method(pair: CloudPair, options: RegistrationOptions, progress: Progress) -> Minimum:
    """Run method "mpe" on all points, or "mpl" with a sparse search and trimmed ICP.

    Points of weight 0 are left out.

    Parameters
    ----------
    pair
        Normalized clouds.
    options, progress
        As in `register`.

    Returns
    -------
    Pose between the clouds of the pair.
    """
    x, y, start = pair.source_cloud, pair.target_cloud, np.eye(4)
    if options.initial_transform is not None:
        start = pair.from_caller(np.array(options.initial_transform))
    source, target = apply(start, x.weighted(pair.source)), y.weighted(pair.target)
    method = _run_mpe if options.method == "mpe" else _run_mpl
    minimum = method(
        source, target, (x.normalized_weights(), y.normalized_weights()), options, progress
    )
    return replace(minimum, T=minimum.T @ start)


def _run_mpe(
    source: Array, target: Array, weights: Weights, options: RegistrationOptions, progress: Progress
) -> Minimum:
    """Run Algorithm 1 on the source (N, 3) from where it lies."""
    source_weights, target_weights = weights
    with progress.stage("search") as report:
        if options.field == "exact":
            exact = ExactField(target, SOFTENING, target_weights)
            return run_algorithm1(source, exact, options.max_iterations, report, source_weights)
        tree, order = TreeField(target, SOFTENING, target_weights), tree_order(source)
        ordered = None if source_weights is None else source_weights[order]
        return run_algorithm1(source[order], tree, options.max_iterations, report, ordered)


def _run_mpl(
    source: Array, target: Array, weights: Weights, options: RegistrationOptions, progress: Progress
) -> Minimum:
    """Run Algorithm 1 on a sample of each cloud, then trimmed ICP on all points."""
    max_iterations = options.max_iterations
    with progress.stage("search") as report:
        coarse = search_sparse(
            source, target, options.sample_size, max_iterations, options.seed, report, *weights
        )
    with progress.stage("refine") as report:
        tree = NearestNeighbors(target)
        return trimmed_icp(
            source, tree, coarse.T, options.overlap, max_iterations, report, *weights
        )
