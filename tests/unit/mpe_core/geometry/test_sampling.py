"""Samples of points and rows."""

import numpy as np
import pytest

from mpe_core.geometry.sampling import (
    resample_rows,
    sample_points,
    sample_spread_rows,
    sample_weighted_rows,
)

POINTS = np.random.default_rng(0).normal(size=(500, 3))


def rng():
    return np.random.default_rng(1)


def test_a_sample_keeps_the_order_of_the_cloud_and_repeats_no_point():
    drawn = sample_points(POINTS, 60, rng())
    rows = [int(np.flatnonzero((point == POINTS).all(axis=1))[0]) for point in drawn]
    assert rows == sorted(set(rows))
    assert len(rows) == 60
    np.testing.assert_array_equal(sample_points(POINTS, 500, rng()), POINTS)
    np.testing.assert_array_equal(sample_points(POINTS, 501, rng()), POINTS)


def test_a_weighted_sample_has_each_point_as_often_as_its_weight_asks_for():
    weights = np.zeros(500)
    weights[[3, 100]] = 1, 3
    drawn = sample_points(POINTS, 40, rng(), weights)
    np.testing.assert_array_equal(drawn, np.repeat(POINTS[[3, 100]], [10, 30], axis=0))


@pytest.mark.parametrize("count", [1, 7, 1000])
def test_resampling_differs_from_the_exact_shares_by_less_than_one(count):
    weights = np.random.default_rng(2).lognormal(0, 1, 50)
    share = count * weights / weights.sum()
    assert np.abs(np.bincount(resample_rows(weights, count), minlength=50) - share).max() < 1


def test_weighted_rows_follow_the_weights_and_skip_zero():
    weights, draws = np.array([0.0, 1, 2, 4]), np.random.default_rng(4)
    first = np.array([sample_weighted_rows(weights, 3, draws)[0] for _ in range(7000)])
    share = np.bincount(first, minlength=4) / len(first)
    np.testing.assert_allclose(share, weights / weights.sum(), atol=0.02)  # 3 sigma
    np.testing.assert_array_equal(np.sort(sample_weighted_rows(weights, 9, draws)), [1, 2, 3])


def test_a_spread_sample_leaves_smaller_gaps_than_a_random_one():
    points, weights = POINTS.astype(np.float32), np.ones(500, np.float32)

    def gap(rows):
        return np.linalg.norm(points[:, None] - points[rows], axis=2).min(axis=1).max()

    spread = sample_spread_rows(points, weights, 50, rng())
    assert len(set(spread)) == 50
    assert gap(spread) < gap(sample_weighted_rows(weights, 50, rng()))
    assert len(sample_spread_rows(points[:9], weights[:9], 50, rng())) == 9
