"""Long narrow scans are registered by the part around the scanner; others are left alone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from mpe_core import register
from mpe_core.clouds.near_part import find_near_radius, keep_near_part, scanner_place
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.validate import validate_cloud
from tests.factories.clouds import bunny, room
from tests.factories.worlds import World, scan_world

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def corridor() -> Array:
    """Scan of a corridor of 80 by 2.4 by 2.6 metres with things along its walls."""
    rng = np.random.default_rng(1)
    count = 60
    sizes = rng.uniform((0.3, 0.2, 0.4), (1.6, 0.5, 2.2), (count, 3))
    sides = rng.choice([-1, 1], count)
    feet = np.column_stack([rng.uniform(-40, 40, count), sides * (1.2 - sizes[:, 1] / 2)])
    walls = [[0, -1.25, 1.3], [0, 1.25, 1.3], [0, 0, 2.65]]
    world = World(
        centres=np.vstack([walls, np.column_stack([feet, sizes[:, 2] / 2])]),
        sizes=np.vstack([[[80, 0.1, 2.6], [80, 0.1, 2.6], [80, 2.4, 0.1]], sizes]),
        yaws=np.zeros(count + 3),
    )
    place = np.array([0.0, 0.0, 1.5])
    return scan_world(world, place, rng, elevations_deg=(-60, 60), noise=0.003).points


def test_a_corridor_loses_its_ends(corridor: Array) -> None:
    cloud = validate_cloud(corridor)
    _, radius = normalize_pair(cloud, cloud).radii
    near_radius = find_near_radius(cloud, radius, np.zeros(3))
    assert near_radius is not None
    assert 1.2 < near_radius < 0.8 * radius
    weights = keep_near_part(cloud, near_radius, np.zeros(3)).weights
    np.testing.assert_array_equal(weights > 0, np.linalg.norm(corridor, axis=1) <= near_radius)


def test_scans_and_noise_are_kept_whole(data) -> None:
    rng = np.random.default_rng(0)
    shape = bunny(data)
    noisy = shape + rng.normal(0, 0.02 * shape.std(), shape.shape)
    ball = rng.normal(size=(4000, 3))
    for points in (shape, noisy, ball, room(rng)):
        cloud = validate_cloud(points)
        _, radius = normalize_pair(cloud, cloud).radii
        assert find_near_radius(cloud, radius, scanner_place(cloud, None)) is None


def test_all_points_of_a_corridor_can_be_inliers(corridor: Array) -> None:
    turned = corridor @ np.diag([-1.0, -1.0, 1.0]) + [7, 8, 9]
    found = register(turned, corridor)
    moved = turned @ found.T_target_source[:3, :3].T + found.T_target_source[:3, 3]
    assert found.accepted
    assert np.abs(moved - corridor).max() < 0.02  # at 40 m
    assert len(found.inliers) == len(turned)
