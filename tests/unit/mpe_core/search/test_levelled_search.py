"""Levelled scenes are found by what stands on their ground, also with little in common."""

import numpy as np
import pytest

from mpe_core import RegistrationOptions
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.preprocess import prepare_clouds
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.rigid import apply, inverse, rotation_error
from mpe_core.kernels.shift_windows import PLANES
from mpe_core.search.levelled_effort import QUICK_LEVELLED, THOROUGH_LEVELLED, LevelledEffort
from mpe_core.search.levelled_pair import level_clouds
from mpe_core.search.levelled_search import find_levelled_poses
from tests.factories.clouds import motion, random_rotation
from tests.factories.worlds import World, hall, relative_pose, scan_world, street

EFFORTS = (
    pytest.param(QUICK_LEVELLED, id="quick"),
    pytest.param(THOROUGH_LEVELLED, id="thorough"),
)


def first_right(
    world: World, places: list[list[float]], seed: int, effort: LevelledEffort, *, knows: bool
) -> int | None:
    """Rank of the first candidate near the truth, for scans of the world from two places."""
    rng = np.random.default_rng(seed)
    source = scan_world(world, np.array(places[0]), rng, yaw=2.0)
    target = scan_world(world, np.array(places[1]), rng)
    away = motion(source.points, random_rotation(rng), rng)
    truth = relative_pose(source, target) @ inverse(away)
    pair = normalize_pair(validate_cloud(apply(away, source.points)), validate_cloud(target.points))
    at = away[:3, 3].tolist()
    options = RegistrationOptions(
        source_viewpoint=at if knows else None, target_viewpoint=(0, 0, 0) if knows else None
    )
    levelled = level_clouds(*prepare_clouds(pair, options))
    assert levelled is not None
    found = [
        find_levelled_poses(cloud, levelled.target, effort, lambda fraction: None)
        for cloud in levelled.source
    ]
    poses = np.concatenate([each.poses for each in found])
    order = np.argsort(-np.concatenate([each.scores for each in found]), kind="stable")
    T = pair.from_caller(truth)
    assert rotation_error(np.eye(4), T) > 10  # the start itself is wrong
    for rank, row in enumerate(order):
        moved = np.linalg.norm(poses[row][:3, 3] - T[:3, 3])
        if rotation_error(poses[row], T) < 6 and moved < 0.1:
            return rank
    return None


@pytest.mark.parametrize("effort", EFFORTS)
@pytest.mark.parametrize("knows", [False, True])
@pytest.mark.parametrize("seed", [0, 1])
def test_two_scans_of_a_street_are_laid_on_each_other(
    seed: int, knows: bool, effort: LevelledEffort
) -> None:
    world = street(np.random.default_rng(seed))
    rank = first_right(world, [[12.0, 0.5, 1.8], [-8.0, -0.5, 1.8]], seed, effort, knows=knows)
    assert rank is not None
    assert rank < 4


@pytest.mark.parametrize("effort", EFFORTS)
@pytest.mark.parametrize("seed", [2, 3])
def test_a_hall_is_found_by_what_stands_between_floor_and_ceiling(
    seed: int, effort: LevelledEffort
) -> None:
    """Floor and ceiling match wherever a hall slides, upside down, too."""
    world = hall(np.random.default_rng(seed))
    rank = first_right(world, [[-14.0, -4.0, 1.5], [8.0, 5.0, 1.5]], seed, effort, knows=True)
    assert rank is not None
    assert rank < 8


@pytest.mark.parametrize("effort", EFFORTS)
def test_the_counters_hold_all_cells_that_are_counted(effort: LevelledEffort) -> None:
    assert max(effort.few_counted, effort.max_counted) < 2**PLANES
