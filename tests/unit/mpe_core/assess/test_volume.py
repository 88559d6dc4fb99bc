"""Volumes of points are accepted where they correspond one by one, and else not."""

import numpy as np
import pytest

from mpe_core import register
from mpe_core.assess.volume import find_exact_pose, may_fill_volume
from mpe_core.geometry.rigid import apply, inverse, pose
from tests.factories.clouds import knot, random_rotation


def volume(shape, count, rng):
    if shape == "box":
        return rng.uniform(-1, 1, (count, 3)) * [1, 0.8, 0.6]
    if shape == "haze":
        return rng.normal(0, 0.4, (count, 3))
    return rng.uniform(-1, 1, (8, 3))[rng.integers(8, size=count)] + rng.normal(0, 0.2, (count, 3))


@pytest.mark.parametrize(("shape", "count"), [("box", 1100), ("haze", 1200), ("blobs", 1500)])
def test_unlike_volumes_are_not_accepted(shape, count):
    rng = np.random.default_rng(count)
    found = register(volume(shape, count, rng), volume(shape, count, rng))
    assert not found.accepted


@pytest.mark.parametrize(("shape", "count"), [("box", 1500), ("haze", 2500)])
@pytest.mark.parametrize("noise", [0, 0.002])
def test_volumes_of_the_same_points_are_laid_on_each_other(shape, count, noise):
    rng = np.random.default_rng(count)
    target, truth = volume(shape, count, rng), pose(random_rotation(rng), rng.uniform(-3, 3, 3))
    part = rng.permutation(target)[: 2 * count // 3] + rng.normal(0, noise, (2 * count // 3, 3))
    found = register(apply(inverse(truth), part), target)
    assert found.accepted
    assert not found.ambiguous
    np.testing.assert_allclose(found.T_target_source, truth, atol=noise + 1e-9)


def test_mirrored_points_do_not_correspond():
    points = volume("box", 1200, np.random.default_rng(2))
    assert find_exact_pose(points * [1, 1, -1], points, 0) is None


def test_a_noisy_surface_is_no_volume_that_fits_everywhere():
    rng = np.random.default_rng(5)
    target, truth = knot(3000, rng), pose(random_rotation(rng), rng.uniform(-3, 3, 3))
    assert not may_fill_volume(target.astype(np.float32))
    assert may_fill_volume(volume("box", 3000, rng).astype(np.float32))
    noisy = target + rng.normal(0, 0.03, (3000, 3))
    source = knot(3000, rng) + rng.normal(0, 0.03, (3000, 3))
    assert register(apply(inverse(truth), source), noisy).accepted
