"""The ground of a scan is found, and which side of it is up."""

import numpy as np

from mpe_core.clouds.ground import find_ground
from tests.factories.clouds import random_rotation
from tests.factories.worlds import hall, scan_world, street


def test_the_ground_of_a_street_is_found_however_the_scan_is_turned() -> None:
    rng = np.random.default_rng(4)
    scan = scan_world(street(rng), np.array([0.0, 0.0, 1.8]), rng)
    R = random_rotation(rng)
    ground = find_ground(((scan.points / 30) @ R.T).astype(np.float32))
    up = R @ np.array([0.0, 0.0, 1.0])
    assert ground.up @ up > np.cos(np.radians(1.5))
    assert abs(ground.height + 1.8 / 30) < 0.01
    assert ground.is_extremal


def test_a_cloud_without_planes_has_no_share() -> None:
    rng = np.random.default_rng(5)
    ball = rng.normal(size=(3000, 3)).astype(np.float32)
    assert find_ground(ball).share < 0.1
    assert find_ground(ball[:3]).share in (0.0, 1.0)


def test_the_ceiling_is_opposite_to_the_floor() -> None:
    rng = np.random.default_rng(6)
    scan = scan_world(hall(rng), np.array([0.0, 0.0, 1.5]), rng, elevations_deg=(-60, 60))
    points = (scan.points / 20).astype(np.float32)
    ground = find_ground(points)
    other = ground.opposite(points)
    assert other.up @ ground.up < -0.999
    assert abs(-other.height - ground.height - 3.2 / 20) < 0.02
