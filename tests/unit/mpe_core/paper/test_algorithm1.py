"""Algorithm 1."""

import numpy as np
import pytest

from mpe_core.geometry.rigid import apply, axis_rotation, pose
from mpe_core.paper.algorithm1 import ANGLE_TOL, SOFTENING, run_algorithm1
from mpe_core.paper.force_field import ExactField
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import bunny


def test_it_falls_to_the_true_pose_from_up_to_90_degrees(data):
    target = bunny(data)
    field = ExactField(target, SOFTENING)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        R = axis_rotation(rng.normal(size=3), np.radians(rng.uniform(10, 90)))
        source = apply(pose(R.T, 0.3 * rng.normal(size=3)), target)
        truth = pose(R, target.mean(axis=0) - R @ source.mean(axis=0))
        found = run_algorithm1(source, field, 100, lambda fraction: None)
        assert found.converged
        # the last step of the turn, 0.06 degrees, and the bias of the radial S, 0.1 degrees
        allowed = np.degrees(ANGLE_TOL) + 0.1
        assert_pose_close(found.T, truth, source, degrees=allowed, shift=0.01)


def test_a_bound_on_the_iterations_is_kept_and_reported():
    rng = np.random.default_rng(0)
    source, target = rng.normal(size=(2, 50, 3))
    found = run_algorithm1(source, ExactField(target, SOFTENING), 3, lambda fraction: None)
    assert (found.converged, found.iterations) == (False, 3)


def test_without_any_force_it_stays():
    cloud = np.zeros((1, 3))
    found = run_algorithm1(cloud, ExactField(cloud, SOFTENING), 5, lambda fraction: None)
    np.testing.assert_array_equal(found.T, np.eye(4))


def test_what_the_report_raises_ends_it():
    cloud = np.random.default_rng(1).normal(size=(50, 3))

    def stop(fraction):
        raise TimeoutError

    with pytest.raises(TimeoutError):
        run_algorithm1(cloud, ExactField(cloud, SOFTENING), 5, stop)
