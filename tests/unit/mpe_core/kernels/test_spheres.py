"""Spheres through four points, and the one that holds the most."""

import numpy as np
import pytest

from mpe_core.kernels.spheres import fullest_sphere, sphere_through


def on_sphere(rng, count, center, radius):
    rays = rng.normal(size=(count, 3))
    return center + radius * rays / np.linalg.norm(rays, axis=1)[:, None]


@pytest.mark.parametrize("seed", range(4))
def test_the_sphere_goes_through_all_four(seed):
    corners, center = np.random.default_rng(seed).normal(size=(4, 3)), np.empty(3)
    radius = sphere_through(corners, center)
    np.testing.assert_allclose(np.linalg.norm(corners - center, axis=1), radius, rtol=1e-9)


def test_four_points_of_a_plane_have_none():
    corners = np.random.default_rng(0).normal(size=(4, 3))
    corners[3] = corners[0] + 2 * (corners[1] - corners[0]) - (corners[2] - corners[0])
    assert sphere_through(corners, np.empty(3)) == np.inf
    assert sphere_through(np.zeros((4, 3)), np.empty(3)) == np.inf


def test_the_fullest_is_found_among_others_and_large_ones_are_left_out():
    rng = np.random.default_rng(0)
    center, radius = np.array([0.3, -0.2, 0.1]), 1.5
    shell, rest = on_sphere(rng, 40, center, radius), rng.uniform(-1, 1, (200, 3))
    points = np.vstack([rest, shell])
    corners = points[rng.integers(0, 200, (50, 4))]
    corners[31] = shell[:4]
    found, count = fullest_sphere(corners, points, 1e-4, 2.0)
    assert count >= 40
    np.testing.assert_allclose(found, center, atol=1e-9)
    smaller, left = fullest_sphere(corners, points, 1e-4, 1.4)
    assert left < 40
    assert not np.allclose(smaller, center, atol=1e-3)
