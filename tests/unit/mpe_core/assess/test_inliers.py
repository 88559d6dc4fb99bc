"""The inlier threshold, and the pairs within it."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from mpe_core.assess.inliers import estimate_inlier_threshold, find_inliers
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import apply
from tests.factories.clouds import knot


def test_the_threshold_follows_the_noise_and_never_falls_below_the_spacing():
    rng = np.random.default_rng(3)
    residual = np.abs(rng.normal(size=1000))
    stray = np.concatenate([residual, rng.uniform(10, 50, 500)])
    assert estimate_inlier_threshold(np.zeros(100), None, 0.25) == 0.25
    assert estimate_inlier_threshold(residual, 1.0, 0.25) == pytest.approx(3, rel=0.1)
    assert estimate_inlier_threshold(stray, None, 0.25) == pytest.approx(3, rel=0.1)
    assert estimate_inlier_threshold(7 * stray, None, 7 * 0.25) == pytest.approx(
        7 * estimate_inlier_threshold(stray, None, 0.25)
    )


def test_where_nothing_is_near_the_threshold_is_the_spacing():
    assert estimate_inlier_threshold(np.full(50, np.inf), None, 0.25) == 0.25


def test_inliers_are_the_source_points_with_a_target_point_within_the_threshold():
    rng = np.random.default_rng(4)
    target = 20 * knot(2000, rng)
    source = np.vstack([target[::3] + 0.1 * rng.normal(size=(667, 3)), target[:50] + 90])
    source[5] = np.nan
    pair = normalize_pair(validate_cloud(source), validate_cloud(target))
    T = pair.from_caller(np.eye(4))
    inliers = find_inliers(pair, T, 0.2)
    finite = np.flatnonzero(np.isfinite(source[:, 0]))
    distance, nearest = KDTree(target).query(apply(np.eye(4), source[finite]))
    close = distance < 0.2
    np.testing.assert_array_equal(inliers.source, finite[close])
    np.testing.assert_array_equal(inliers.target, nearest[close])
    np.testing.assert_allclose(inliers.distance, distance[close], atol=1e-12)
    assert inliers.rmse() == pytest.approx(np.sqrt(np.mean(distance[close] ** 2)))
