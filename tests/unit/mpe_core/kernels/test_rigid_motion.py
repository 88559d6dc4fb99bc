"""The update of a pose against scipy's rotation vectors."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpe_core.geometry.rigid import pose
from mpe_core.kernels.rigid_motion import update_pose


@pytest.mark.parametrize("angle", [0.0, 1e-13, 1e-6, 0.1, 3.0])
def test_a_pose_is_turned_about_the_origin_and_then_moved(angle):
    rng = np.random.default_rng(0)
    axis, shift = rng.normal(size=3), rng.normal(size=3)
    vector = angle * axis / np.linalg.norm(axis)
    T = pose(Rotation.random(rng=1).as_matrix(), rng.normal(size=3))
    expected = pose(Rotation.from_rotvec(vector).as_matrix(), shift) @ T
    update_pose(T, np.concatenate([vector, shift]))
    np.testing.assert_allclose(T, expected, atol=1e-12)
