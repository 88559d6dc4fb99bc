"""The paper's first half of "mpl": Algorithm 1 on a random sample of each cloud."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.sampling import random_rows
from mpe_core.paper.algorithm1 import EPS, Descent, descend
from mpe_core.paper.force_field import ExactField

Array = NDArray[np.float64]


def sparse_mpe(
    source: Array,
    target: Array,
    sample_size: int,
    max_iterations: int,
    seed: int,
    report: Callable[[float], None],
    source_weights: Array | None = None,
    target_weights: Array | None = None,
) -> Descent:
    """Coarse pose of the centred, scaled clouds (N, 3), (M, 3) from sample_size points of each.

    Weights (N,), (M,) say how often a point is drawn, and all that are drawn pull alike: the few
    points of the sample are spent where they count.
    """
    rng = np.random.default_rng(seed)
    x = random_rows(source, sample_size, rng, source_weights)
    y = random_rows(target, sample_size, rng, target_weights)
    return descend(x, ExactField(y, EPS), max_iterations, report)
