"""The paper's first half of "mpl": Algorithm 1 on a random sample of each cloud."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.sampling import sample_points
from mpe_core.paper.algorithm1 import SOFTENING, run_algorithm1
from mpe_core.paper.force_field import ExactField
from mpe_core.refine.minimum import Minimum

Array = NDArray[np.float64]


def search_sparse(
    source: Array,
    target: Array,
    sample_size: int,
    max_iterations: int,
    seed: int,
    report: Callable[[float], None],
    source_weights: Array | None = None,
    target_weights: Array | None = None,
) -> Minimum:
    """Find a coarse pose of centered, scaled clouds from a sample of each.

    Parameters
    ----------
    source, target
        (N, 3) and (M, 3) clouds.
    sample_size
        Points of each sample.
    max_iterations, report
        As in `run_algorithm1`.
    seed
        Seed of the samples.
    source_weights, target_weights
        (N,) and (M,) weights: how often a point is drawn. All drawn points attract alike, so the
        sample is spent where the weight is.
    """
    rng = np.random.default_rng(seed)
    x = sample_points(source, sample_size, rng, source_weights)
    y = sample_points(target, sample_size, rng, target_weights)
    return run_algorithm1(x, ExactField(y, SOFTENING), max_iterations, report)
