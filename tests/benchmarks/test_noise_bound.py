"""The Cramer-Rao bound that the page on noise prints."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.paper.noise import bound
from mpe_core.geometry.rigid import fit, rotation_error
from tests.factories.clouds import Array, knot


def median_of_fits(cloud: Array, sigma: float, trials: int) -> float:
    """Degrees that the fit with known pairs is off, in the median."""
    rng = np.random.default_rng(1)
    found = [fit(cloud + rng.normal(0, sigma, cloud.shape), cloud) for _ in range(trials)]
    return float(np.median([rotation_error(T, np.eye(4)) for T in found]))


def test_far_below_the_spacing_pairs_need_not_be_known() -> None:
    cloud = knot(300, np.random.default_rng(0))
    # the median of 400 fits is known to about 5 %
    assert bound(cloud, 1e-4) == pytest.approx(median_of_fits(cloud, 1e-4, 400), rel=0.15)


def test_beyond_the_spacing_less_can_be_told_than_with_known_pairs() -> None:
    cloud = knot(300, np.random.default_rng(0))
    assert bound(cloud, 0.1) > 1.5 * median_of_fits(cloud, 0.1, 400)
