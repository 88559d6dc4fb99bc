"""What counts as a rotation and as a rigid pose."""

import numpy as np
import pytest

from mpe_core.geometry.validation import ORTHONORMALITY_TOL, is_rigid, is_rotation
from tests.factories.clouds import random_rotation


def test_a_rotation_may_be_rounded_but_not_scaled_or_mirrored():
    R = random_rotation(np.random.default_rng(0))
    assert is_rotation(R)
    assert is_rotation(R.astype(np.float32).astype(float))
    assert not is_rotation(R * (1 + ORTHONORMALITY_TOL))
    assert not is_rotation(R @ np.diag([1.0, 1, -1]))
    assert not is_rotation(np.full((3, 3), np.nan))


@pytest.mark.parametrize("last", [(0, 0, 0, 2), (1e-9, 0, 0, 1)])
def test_a_pose_has_the_last_row_of_an_affine_map(last):
    T = np.eye(4)
    T[:3, 3] = 5
    assert is_rigid(T)
    T[3] = last
    assert not is_rigid(T)
