"""Descent of several poses together on planes that are fitted as they are needed."""

import numpy as np
import pytest

from mpe_core.clouds.preprocess import prepare_cloud
from mpe_core.geometry.rigid import axis_rotation, pose
from mpe_core.refine.gauss_newton import minimize_point_to_plane
from mpe_core.refine.target_planes import TargetPlanes
from tests.factories.clouds import knot

ALL_MOTIONS = np.eye(6)


@pytest.fixture(scope="module")
def cloud():
    return prepare_cloud(2 * knot(20_000, np.random.default_rng(0)) - [1.1, 0.3, 0.2])


@pytest.fixture(scope="module")
def starts():
    """(3, 4, 4) poses off the identity by 0, 2 and 4 degrees."""
    axis = np.array([1.0, 2, 3])
    return np.array([pose(axis_rotation(axis, a), np.full(3, a / 8)) for a in (0, 0.035, 0.07)])


def descend(cloud, starts, max_steps, planes=None):
    planes = TargetPlanes(cloud.fine, cloud.surface.spacing) if planes is None else planes
    return minimize_point_to_plane(cloud.sample(0), planes, starts, ALL_MOTIONS, max_steps)


def test_each_pose_takes_the_steps_that_it_needs(cloud, starts):
    minima = descend(cloud, starts, 50)
    assert all(each.converged for each in minima)
    steps = [each.iterations for each in minima]
    assert steps[0] < steps[2] < 50
    for each in minima:
        np.testing.assert_allclose(each.T, np.eye(4), atol=1e-3)


def test_poses_that_run_out_of_steps_have_not_converged(cloud, starts):
    minima = descend(cloud, starts[1:], 1)
    assert [each.iterations for each in minima] == [1, 1]
    assert not any(each.converged for each in minima)


def test_neither_other_poses_nor_planes_that_are_known_change_a_bit(cloud, starts):
    together = descend(cloud, starts, 50)
    known = TargetPlanes(cloud.fine, cloud.surface.spacing)
    known.planes_at(np.arange(len(cloud.fine), dtype=np.int32))
    for start, each in zip(starts, together, strict=True):
        (alone,) = descend(cloud, start[None], 50)
        (among_known,) = descend(cloud, start[None], 50, known)
        np.testing.assert_array_equal(alone.T, each.T)
        np.testing.assert_array_equal(among_known.T, each.T)


def test_only_planes_next_to_the_points_are_fitted(cloud, starts):
    planes = TargetPlanes(cloud.fine, cloud.surface.spacing)
    descend(cloud, starts[:1], 50, planes)
    assert 0 < planes.is_fitted.sum() < 0.7 * len(cloud.fine)
