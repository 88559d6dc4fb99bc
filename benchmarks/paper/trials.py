"""Bunnies from anywhere in SO(3)."""

from __future__ import annotations

import numpy as np

from mpe_core.geometry.rigid import apply, inverse
from tests.factories.clouds import Array, Trial, motion, moved, random_rotation


def anywhere(cloud: Array, seed: int, *, noise: float = 0.0, outliers: int = 0) -> Trial:
    """Return the cloud as target, and a disturbed copy turned evenly over SO(3) as source."""
    rng = np.random.default_rng(seed)
    trial = moved(cloud, rng, noise=noise, outliers=outliers)
    T = motion(trial.source, random_rotation(rng), rng)
    return Trial(apply(T, trial.source), trial.target, trial.T_target_source @ inverse(T))
