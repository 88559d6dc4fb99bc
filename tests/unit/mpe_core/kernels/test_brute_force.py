"""Distances of the nearest points against all distances."""

import numpy as np
import pytest

from mpe_core.kernels.brute_force import nearest_distances


@pytest.mark.parametrize("count", [1, 4, 60])
def test_the_nearest_are_those_of_the_sorted_distances(count):
    points = np.random.default_rng(count).normal(size=(count, 3))
    rows = np.array([0, count - 1, count // 2])
    found = nearest_distances(points, rows, 6)
    every = np.linalg.norm(points[rows, None] - points, axis=2)
    every[np.arange(3), rows] = np.inf
    expected = np.full((3, 6), np.inf)
    expected[:, : min(6, count)] = np.sort(every, axis=1)[:, :6]
    np.testing.assert_allclose(found, expected, rtol=1e-14)


def test_copies_lie_at_no_distance_and_the_point_itself_does_not_count():
    points = np.array([[1.0, 2, 3], [1, 2, 3], [1, 2, 5]])
    np.testing.assert_array_equal(nearest_distances(points, np.array([0, 2]), 2), [[0, 2], [2, 2]])
