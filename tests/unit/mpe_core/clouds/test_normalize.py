"""Centring and scaling of a pair of clouds."""

import numpy as np
import pytest

from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import apply, axis_rotation, pose


def test_a_pose_between_centred_clouds_becomes_the_callers():
    rng = np.random.default_rng(1)
    x = rng.normal(size=(50, 3)) * 20 + [5e5, 4e6, 100]
    truth = pose(axis_rotation(np.array([1.0, 2, 3]), 1.0), np.array([10.0, -2e5, 30]))
    y = apply(truth, x)
    pair = normalize_pair(validate_cloud(x), validate_cloud(y))
    np.testing.assert_allclose(np.abs(pair.source).max(), 1, atol=0.5)
    np.testing.assert_allclose(
        apply(pair.to_caller(pose(truth[:3, :3], np.zeros(3))), x), y, atol=1e-7
    )


def test_stray_points_do_not_set_the_unit():
    x = np.random.default_rng(2).normal(size=(1000, 3))
    with_stray = np.vstack([x, [[500, 0, 0]]])
    clean, stray = (
        normalize_pair(validate_cloud(c), validate_cloud(x)).unit for c in (x, with_stray)
    )
    assert stray == pytest.approx(clean, rel=0.05)
