"""Points never stand where the other scanner saw through, at the right pose."""

import numpy as np
import pytest

from mpe_core.assess.free_space import FreeSpace
from mpe_core.geometry.cell_list import voxel_downsample
from tests.factories.worlds import (
    ROOM,
    MergedScan,
    hall,
    relative_pose,
    rooms,
    scan_rooms,
    scan_world,
    street,
)


@pytest.mark.parametrize("build", [street, hall])
def test_the_truth_violates_no_free_space_and_a_slide_does(build) -> None:
    rng = np.random.default_rng(2)
    world = build(rng)
    source = scan_world(world, np.array([6.0, 0.6, 1.5]), rng, yaw=1.0)
    target = scan_world(world, np.array([-3.0, -0.4, 1.5]), rng)
    unit = 30.0
    space = FreeSpace(
        (source.points / unit).astype(np.float32),
        (target.points / unit).astype(np.float32),
        np.zeros((1, 3)),
        np.zeros((1, 3)),
    )
    T = relative_pose(source, target)
    T[:3, 3] /= unit
    right = space.violation(T)
    slid = T.copy()
    slid[0, 3] += 8.0 / unit  # along the street, or by one bay of the pillars
    assert right < 0.1
    assert space.violation(slid) > 2 * right + 0.05


def violations(source: MergedScan, target: MergedScan, *shifts: tuple[float, float]) -> list[float]:
    """Violation at the truth, and at these shifts of the source in metres."""
    unit = ROOM[0]
    clouds = [
        voxel_downsample((scan.points / unit).astype(np.float32), 0.005)
        for scan in (source, target)
    ]
    space = FreeSpace(*clouds, source.viewpoints / unit, target.viewpoints / unit)
    found = []
    for x, y in ((0.0, 0.0), *shifts):
        T = np.eye(4)
        T[:2, 3] = np.array([x, y]) / unit
        found.append(space.violation(T))
    return found


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("max_range", [80.0, 4.0])
def test_rooms_scanned_one_by_one_violate_little_at_the_truth_alone(max_range, seed) -> None:
    """Walls hide what only the scanner of the next room measured, and short beams do not end."""
    rng = np.random.default_rng(seed)
    world = rooms(rng, 3)
    scans = [scan_rooms(world, rng, range(3), max_range) for _ in range(2)]
    right, *shifted = violations(*scans, (0.8, 0.0), (0.0, 0.8), (ROOM[0], 0.0))
    assert right < 0.01
    assert min(shifted) > 0.05


def test_more_stations_in_the_same_rooms_do_not_violate_more() -> None:
    rng = np.random.default_rng(0)
    world = rooms(rng, 2)
    few, many = ([scan_rooms(world, rng, [0, 1] * times) for _ in range(2)] for times in (1, 5))
    for source, target in ((few, few), (many, many), (few, many)):
        right, shifted = violations(source[0], target[1], (0.8, 0.0))
        assert right < 0.01
        assert shifted > 0.1


@pytest.mark.parametrize("distance", [0.8, 3.0])
def test_a_thin_thing_in_front_of_what_the_other_saw_counts_however_far_the_scanner(distance):
    """A board of 0.2 by 0.4 radii, 0.08 radii in front of a wall."""
    rng = np.random.default_rng(0)
    wall = np.column_stack([np.full(20_000, distance), rng.uniform(-1, 1, (20_000, 2))])
    board = np.column_stack(
        [np.full(4000, distance - 0.08), rng.uniform((-0.1, -0.2), (0.1, 0.2), (4000, 2))]
    )
    seen, other = wall.astype(np.float32), np.vstack([wall, board]).astype(np.float32)
    space = FreeSpace(other, seen, np.zeros((1, 3)), np.zeros((1, 3)))
    share = len(board) / len(other)
    assert space.violation(np.eye(4)) > 0.8 * share
    assert FreeSpace(seen, seen, np.zeros((1, 3)), np.zeros((1, 3))).violation(np.eye(4)) == 0
