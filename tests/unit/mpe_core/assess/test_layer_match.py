"""The right pose matches best as seen from above."""

import numpy as np
import pytest

from mpe_core import RegistrationOptions
from mpe_core.assess.layer_match import LayerMatch
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.preprocess import prepare_clouds
from mpe_core.clouds.validate import validate_cloud
from mpe_core.search.levelled_pair import level_clouds
from tests.factories.worlds import relative_pose, scan_world, street


@pytest.mark.parametrize("knows", [False, True])
def test_a_slide_along_the_street_has_less_support_than_the_truth(knows: bool) -> None:
    rng = np.random.default_rng(7)
    world = street(rng)
    source = scan_world(world, np.array([5.0, 0.5, 1.8]), rng, yaw=0.7)
    target = scan_world(world, np.array([-5.0, -0.5, 1.8]), rng)
    pair = normalize_pair(validate_cloud(source.points), validate_cloud(target.points))
    place = (0.0, 0.0, 0.0) if knows else None
    options = RegistrationOptions(source_viewpoint=place, target_viewpoint=place)
    levelled = level_clouds(*prepare_clouds(pair, options))
    assert levelled is not None
    truth = relative_pose(source, target)
    slid, tilted = truth.copy(), truth.copy()
    slid[0, 3] += 9.0
    tilted[:3, :3] = tilted[:3, :3] @ [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    poses = [pair.from_caller(T) for T in (truth, slid, tilted)]
    right, wrong, unknown = LayerMatch(levelled).relative_scores(poses, [True, True, True])
    assert right == 1
    assert wrong is not None
    assert wrong < 0.5
    assert unknown is None
    assert LayerMatch(levelled).relative_scores(poses, [False] * 3) == [None] * 3
