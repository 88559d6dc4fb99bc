"""Bounds and moments in tasks against numpy's in one piece."""

import numpy as np
import pytest

from mpe_core.geometry.bounds import measure_extent, scatter_matrix
from mpe_core.kernels.bounds import ROWS_PER_TASK


@pytest.mark.parametrize("count", [1, 3, ROWS_PER_TASK, 3 * ROWS_PER_TASK + 7])
@pytest.mark.parametrize("away", [0.0, 5e6])
def test_extent_and_scatter_are_those_of_numpy(count, away):
    points = away + np.random.default_rng(count).normal(size=(count, 3)) * [1, 10, 0.1]
    found = measure_extent(points)
    np.testing.assert_array_equal(found.low, points.min(axis=0))
    np.testing.assert_array_equal(found.high, points.max(axis=0))
    np.testing.assert_allclose(found.mean, points.mean(axis=0), rtol=1e-12, atol=1e-12)
    offsets = points - points.mean(axis=0)
    assert found.max_coordinate == np.abs(points).max()
    assert found.max_offset == pytest.approx(np.abs(offsets).max(), rel=1e-6)
    if count > 1:
        unit = offsets / found.max_offset
        np.testing.assert_allclose(
            scatter_matrix(points, found), unit.T @ unit, rtol=1e-6, atol=1e-6
        )


def test_the_mean_of_one_place_is_that_place():
    found = measure_extent(np.full((9999, 3), 0.1))
    np.testing.assert_array_equal(found.mean, np.full(3, 0.1))
    assert found.max_offset == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_one_point_that_is_not_finite_shows_in_the_mean(bad):
    points = np.random.default_rng(0).normal(size=(2 * ROWS_PER_TASK, 3))
    for row in (0, ROWS_PER_TASK + 5):
        odd = points.copy()
        odd[row, 1] = bad
        assert not np.isfinite(measure_extent(odd).mean[1])
    assert not np.isfinite(
        measure_extent(np.vstack([points, [[0, np.inf, 0], [0, -np.inf, 0]]])).mean[1]
    )
