"""The builders of the tests keep their own laws."""

import numpy as np
import pytest

from mpe_core.geometry.rigid import rotation_error
from tests.factories.clouds import random_rotation


def test_random_rotations_are_rotations_and_spread_over_all_of_them():
    rng = np.random.default_rng(4)
    R = np.array([random_rotation(rng) for _ in range(4000)])
    np.testing.assert_allclose(
        R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (4000, 1, 1)), atol=1e-12
    )
    angles = np.array([rotation_error(np.eye(3), r) for r in R])
    # even on SO(3): the share with an angle up to a is (a - sin a) / pi; 0.03 is 4 sigma
    for a in (np.pi / 3, np.pi / 2, 2.5):
        assert np.mean(np.radians(angles) < a) == pytest.approx((a - np.sin(a)) / np.pi, abs=0.03)
