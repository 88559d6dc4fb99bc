"""Points never stand where the other scanner saw through, at the right pose."""

import numpy as np
import pytest

from mpe_core.assess.free_space import FreeSpace
from tests.factories.worlds import hall, relative_pose, scan_world, street


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
        np.zeros(3),
        np.zeros(3),
    )
    T = relative_pose(source, target)
    T[:3, 3] /= unit
    right = space.violation(T)
    slid = T.copy()
    slid[0, 3] += 8.0 / unit  # along the street, or by one bay of the pillars
    assert right < 0.1
    assert space.violation(slid) > 2 * right + 0.05
