"""Places of scanners: their order and copies tell nothing, and each has the points near it."""

import numpy as np
import pytest

from mpe_core.geometry.viewpoints import as_viewpoints, nearest_viewpoint

PLACES = [(3.0, 1, 2), (0.0, 5, 5), (3.0, 1, 1)]


def test_one_place_is_a_list_of_one():
    np.testing.assert_array_equal(as_viewpoints((1, 2, 3)), [[1, 2, 3]])
    np.testing.assert_array_equal(as_viewpoints(np.array([[1, 2, 3]])), [[1, 2, 3]])


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [2, 2, 1, 0, 1]])
def test_order_and_copies_of_the_places_tell_nothing(order):
    told = as_viewpoints([PLACES[row] for row in order])
    np.testing.assert_array_equal(told, as_viewpoints(PLACES))


@pytest.mark.parametrize("count", [1, 2, 9])
def test_each_point_has_the_viewpoint_nearest_to_it(count):
    rng = np.random.default_rng(count)
    points = rng.normal(size=(500, 3)).astype(np.float32)
    viewpoints = rng.normal(size=(count, 3))
    distance = np.linalg.norm(points[:, None] - viewpoints, axis=2)
    np.testing.assert_array_equal(nearest_viewpoint(points, viewpoints), distance.argmin(axis=1))
