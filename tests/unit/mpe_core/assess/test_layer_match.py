"""What stands on the ground of one scan must not be missing in the other."""

import numpy as np

from mpe_core.assess.layer_conflict import LayerConflict
from mpe_core.clouds.ground import find_ground
from tests.factories.worlds import relative_pose, scan_world, street

UNIT = 30.0


def test_the_truth_has_less_conflict_than_a_slide_along_the_street() -> None:
    rng = np.random.default_rng(7)
    world = street(rng)
    source = scan_world(world, np.array([5.0, 0.5, 1.8]), rng, yaw=0.7)
    target = scan_world(world, np.array([-5.0, -0.5, 1.8]), rng)
    x, y = ((scan.points / UNIT).astype(np.float32) for scan in (source, target))
    layers = LayerConflict(x, y, find_ground(x), find_ground(y))
    T = relative_pose(source, target)
    T[:3, 3] /= UNIT
    right, slid = layers.share(T), T.copy()
    slid[0, 3] += 9.0 / UNIT
    wrong = layers.share(slid)
    assert right is not None
    assert wrong is not None
    assert 1.5 * right < wrong


def test_grounds_that_do_not_lie_on_each_other_are_not_compared() -> None:
    rng = np.random.default_rng(8)
    scan = scan_world(street(rng), np.array([0.0, 0.0, 1.8]), rng)
    x = (scan.points / UNIT).astype(np.float32)
    layers = LayerConflict(x, x, find_ground(x), find_ground(x))
    raised = np.eye(4)
    raised[2, 3] = 0.3
    assert layers.share(raised) is None
    on_its_side = np.eye(4)
    on_its_side[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    assert layers.share(on_its_side) is None
    assert layers.share(np.eye(4)) == 0
