"""Levelled scenes are found by what stands on their ground, also with little in common."""

import numpy as np
import pytest

from mpe_core.clouds.ground import find_ground
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.preprocess import prepare_cloud
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import apply, inverse, rotation_error
from mpe_core.search.levelled_search import LevelledCloud, find_levelled_poses
from tests.factories.clouds import motion, random_rotation
from tests.factories.worlds import relative_pose, scan_world, street


@pytest.mark.parametrize("seed", [0, 1])
def test_two_scans_of_a_street_are_laid_on_each_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = street(rng)
    source = scan_world(world, np.array([12.0, 0.5, 1.8]), rng, yaw=2.0)
    target = scan_world(world, np.array([-8.0, -0.5, 1.8]), rng)
    away = motion(source.points, random_rotation(rng), rng)
    truth = relative_pose(source, target) @ inverse(away)
    pair = normalize_pair(validate_cloud(apply(away, source.points)), validate_cloud(target.points))
    x, y = (prepare_cloud(points).surface.points for points in (pair.source, pair.target))
    ground_x, ground_y = find_ground(x), find_ground(y)
    assert min(ground_x.share, ground_y.share) > 0.15
    found = find_levelled_poses(
        LevelledCloud.from_points(x, ground_x),
        LevelledCloud.from_points(y, ground_y),
        16,
        lambda fraction: None,
    )
    T = pair.from_caller(truth)
    assert rotation_error(np.eye(4), T) > 10  # the start itself is wrong
    near = [
        k
        for k, pose in enumerate(found.poses)
        if rotation_error(pose, T) < 6 and np.linalg.norm(pose[:3, 3] - T[:3, 3]) < 0.1
    ]
    assert near
    assert near[0] < 4
