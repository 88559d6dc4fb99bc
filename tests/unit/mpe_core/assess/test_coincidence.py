"""Few points are found where they correspond one by one, and never accepted where they do not."""

import numpy as np
import pytest

from mpe_core import RegistrationOptions, register
from mpe_core.assess.coincidence import are_scattered, estimate_dimension, find_coincidences
from mpe_core.geometry.rigid import apply, inverse, pose
from tests.factories.checks import assert_pose_close
from tests.factories.clouds import knot, random_rotation


def markers(count, rng):
    return rng.uniform(-1, 1, (count, 3)) * [3, 2, 1]


def motion(rng):
    return pose(random_rotation(rng), rng.uniform(-9, 9, 3))


@pytest.mark.parametrize("count", [5, 7, 15, 90, 700])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_same_points_are_laid_on_each_other_exactly(count, seed):
    rng = np.random.default_rng(seed)
    target, truth = markers(count, rng), motion(rng)
    source = rng.permutation(apply(inverse(truth), target))
    found = register(source, target)
    assert_pose_close(found.T_target_source, truth, source, degrees=1e-5, shift=1e-6)
    assert found.accepted
    assert not found.ambiguous
    assert len(found.inliers) == count
    assert len(found.free_directions) == 0


@pytest.mark.parametrize("count", [12, 40, 200])
def test_noise_and_points_of_one_cloud_alone_are_no_obstacle(count):
    rng = np.random.default_rng(count)
    target, truth = markers(count, rng), motion(rng)
    seen = target[: 2 * count // 3] + rng.normal(0, 0.002, (2 * count // 3, 3))
    source = apply(inverse(truth), np.vstack([seen, markers(count // 4, rng)]))
    found = register(source, target)
    assert found.accepted
    assert_pose_close(found.T_target_source, truth, source, degrees=0.5, shift=0.01)
    deviation = np.sqrt(np.diag(found.covariance))
    assert 0 < deviation[3:].max() < 0.01


@pytest.mark.parametrize("count", [5, 9, 20, 70, 160, 250])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_unlike_points_are_not_accepted(count, seed):
    rng = np.random.default_rng(seed)
    found = register(markers(count, rng), markers(count, rng))
    assert not found.accepted


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_mirrored_markers_are_not_accepted(seed):
    points = markers(12, np.random.default_rng(seed))
    assert not register(points * [1, 1, -1], points).accepted


def test_equal_sides_are_ambiguous():
    rng = np.random.default_rng(0)
    square = np.array([[1.0, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    corners = np.vstack([square, square * 0.5 + [0, 0, 1]])
    found = register(apply(motion(rng), corners), corners)
    assert found.ambiguous


def test_what_the_caller_knows_holds_for_markers_too():
    rng = np.random.default_rng(1)
    points = markers(10, rng)
    turned = pose(random_rotation(rng), np.zeros(3))
    options = RegistrationOptions(initial_transform=turned, max_rotation_deg=10)
    assert not register(points, points, options).accepted


def test_surfaces_are_told_from_scattered_points():
    rng = np.random.default_rng(0)
    assert not are_scattered(knot(400, rng))
    assert are_scattered(markers(400, rng))
    assert are_scattered(knot(20, rng))
    t = np.linspace(0, 6, 300)
    assert estimate_dimension(np.column_stack([np.cos(t), np.sin(t), t])) < 1.5


def test_many_points_are_not_asked():
    points = markers(1001, np.random.default_rng(0))
    assert find_coincidences(points, points, 0) is None
