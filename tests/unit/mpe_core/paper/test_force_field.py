"""Torque, gravity and the limits of the force field; the sums are tested with their kernels."""

import numpy as np
import pytest

from mpe_core.paper.force_field import CLIP_DISTANCE, ExactField, TreeField, torque_and_gravity


def test_torque_and_gravity_are_equations_8_and_9():
    rng = np.random.default_rng(8)
    points, force, center = rng.normal(size=(20, 3)), rng.normal(size=(20, 3)), rng.normal(size=3)
    T, S = np.zeros(3), np.zeros(3)
    for p, f in zip(points, force, strict=True):
        v = (p - center) / np.linalg.norm(p - center)
        T += np.cross(v, f - (f @ v) * v)
        S += (f @ v) * v
    torque, gravity = torque_and_gravity(points, center, force)
    np.testing.assert_allclose(torque, T, atol=1e-12)
    np.testing.assert_allclose(gravity, S, atol=1e-12)


def test_a_point_at_the_center_neither_turns_nor_moves():
    torque, gravity = torque_and_gravity(np.zeros((1, 3)), np.zeros(3), np.ones((1, 3)))
    assert not torque.any()
    assert not gravity.any()


@pytest.mark.parametrize("field", [ExactField, TreeField])
def test_points_beyond_all_measure_neither_pull_nor_are_pulled(field):
    near = np.random.default_rng(0).normal(size=(50, 3))
    far = np.array([[1e300, 0, 0], [0, -1e200, 1e30]])
    np.testing.assert_array_equal(field(np.vstack([near, far]), 0.1).force(near).shape, near.shape)
    alone, joined = field(near, 0.1).force(near), field(np.vstack([near, far]), 0.1).force(near)
    np.testing.assert_allclose(joined, alone, atol=1e-3 * np.abs(alone).max())
    assert np.abs(field(near, 0.1).force(far)).max() < 100 / CLIP_DISTANCE
