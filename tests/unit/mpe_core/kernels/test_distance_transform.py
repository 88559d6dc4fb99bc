"""The distance transform against all distances between cells."""

import numpy as np
import pytest

from mpe_core.kernels.distance_transform import (
    UNREACHED,
    empty_hull,
    lower_envelope,
    nearest_point_index,
)


@pytest.mark.parametrize("seed", range(5))
def test_a_line_is_the_lower_envelope_of_its_parabolas(seed):
    rng = np.random.default_rng(seed)
    n = 40
    squared = np.where(rng.random(n) < 0.3, rng.integers(0, 200, n), UNREACHED).astype(np.int32)
    squared[0] = 7
    feature, before = np.arange(n, dtype=np.int32), squared.copy()
    lower_envelope(squared, feature, empty_hull(n))
    q = np.arange(n)
    heights = (q[:, None] - q) ** 2 + before.astype(np.int64)
    np.testing.assert_array_equal(squared, heights.min(axis=1))
    np.testing.assert_array_equal(heights[q, feature], heights.min(axis=1))


def test_an_empty_line_stays_empty():
    squared, feature = np.full(5, UNREACHED), np.full(5, np.int32(-1))
    lower_envelope(squared, feature, empty_hull(5))
    assert (squared == UNREACHED).all()
    assert (feature == -1).all()


@pytest.mark.parametrize("shape", [(1, 1, 1), (9, 4, 12)])
@pytest.mark.parametrize("count", [1, 30])
def test_every_cell_names_a_point_of_the_nearest_occupied_cell(shape, count):
    rng = np.random.default_rng(count)
    origin, size = np.float32([-1, 2, 0.5]), np.float32(0.25)
    inside = rng.uniform(0.01, 0.99, (count, 3)) * shape
    points = (origin + size * inside).astype(np.float32)
    rows = nearest_point_index(points, origin, size, np.array(shape))
    own = ((points - origin) / size).astype(int)
    cells = np.argwhere(np.ones(shape, bool))
    squared = ((cells[:, None] - own) ** 2).sum(axis=2)
    found = squared[np.arange(len(cells)), rows.ravel()]
    np.testing.assert_array_equal(found, squared.min(axis=1))


def test_of_the_points_in_a_cell_the_one_nearest_to_its_center_stands_for_it():
    points = np.float32([[0.1, 0.1, 0.1], [0.5, 0.6, 0.5], [0.9, 0.9, 0.9]])
    rows = nearest_point_index(points, np.zeros(3, np.float32), np.float32(1), np.ones(3, int))
    assert rows[0, 0, 0] == 1
