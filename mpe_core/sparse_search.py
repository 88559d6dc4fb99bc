"""The paper's first half of "mpl": Algorithm 1 on a random sample of each cloud."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mpe_core.descent import EPS, Descent, descend
from mpe_core.potential import ExactField
from mpe_core.sampling import random_rows

Array = NDArray[np.float64]


def sparse_mpe(
    source: Array,
    target: Array,
    sample_size: int,
    max_iterations: int,
    seed: int,
    report: Callable[[float], None],
) -> Descent:
    """Coarse pose of the centred, scaled clouds (N, 3), (M, 3) from sample_size points of each."""
    rng = np.random.default_rng(seed)
    x, y = random_rows(source, sample_size, rng), random_rows(target, sample_size, rng)
    return descend(x, ExactField(y, EPS), max_iterations, report)
