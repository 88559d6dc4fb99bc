"""Farthest-point sampling against the textbook loop."""

import numpy as np

from mpe_core.kernels.farthest_point import farthest_order


def test_farthest_order_is_the_textbook_loop():
    points = np.random.default_rng(3).normal(size=(300, 3)).astype(np.float32)
    expected = [0]
    for _ in range(19):
        distance = np.linalg.norm(points[:, None] - points[expected], axis=2).min(axis=1)
        expected.append(int(distance.argmax()))
    np.testing.assert_array_equal(farthest_order(points, 20), expected)


def test_it_draws_every_point_once_before_any_twice():
    points = np.random.default_rng(4).normal(size=(50, 3)).astype(np.float32)
    np.testing.assert_array_equal(np.sort(farthest_order(points, 50)), np.arange(50))
