"""Rotations spread over SO(3)."""

import numpy as np
from scipy.spatial.transform import Rotation

from mpe_core.geometry.rotations import even_rotations


def test_even_rotations_are_rotations_that_leave_no_gap():
    count = 1152
    rotations = even_rotations(count)
    identity = np.broadcast_to(np.eye(3), (count, 3, 3))
    np.testing.assert_allclose(rotations @ rotations.transpose(0, 2, 1), identity, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotations), 1)
    drawn = Rotation.random(500, rng=2).as_matrix()
    traces = np.einsum("aij,bij->ab", drawn, rotations)
    gap = np.degrees(np.arccos((traces.max(axis=1) - 1) / 2))
    # even cells of SO(3): their angular radius is (6 pi / count)^(1/3)
    assert gap.max() < 1.5 * np.degrees((6 * np.pi / count) ** (1 / 3))
