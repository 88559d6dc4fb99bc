"""Rigid motions."""

import numpy as np
import pytest

from mpe_core.geometry.rigid import (
    apply,
    axis_rotation,
    fit,
    inverse,
    pose,
    rotation_error,
)
from tests.factories.clouds import random_rotation

AXIS = np.array([1.0, -2.0, 0.5])


@pytest.mark.parametrize("degrees", [0.0, 1e-9, 1e-6, 1e-3, 1.0, 90.0, 179.0, 179.999, 180.0])
def test_rotation_error_is_the_angle_between_two_rotations(degrees):
    A = axis_rotation(np.array([3.0, 1, 2]), 2.0)
    B = A @ axis_rotation(AXIS, np.radians(degrees))
    assert rotation_error(A, B) == pytest.approx(degrees, rel=1e-6, abs=1e-13)


@pytest.mark.parametrize(
    "wrong", [np.eye(3) * 1.001, np.diag([1.0, 1, -1]), np.full((3, 3), np.nan)]
)
def test_rotation_error_refuses_what_is_no_rotation(wrong):
    with pytest.raises(ValueError, match="rotation"):
        rotation_error(np.eye(3), wrong)


def test_fit_finds_the_motion_of_paired_points():
    rng = np.random.default_rng(0)
    x = rng.normal(size=(20, 3))
    T = pose(random_rotation(rng), rng.normal(size=3))
    np.testing.assert_allclose(fit(x, apply(T, x)), T, atol=1e-12)
    np.testing.assert_allclose(fit(apply(T, x), x), inverse(T), atol=1e-12)


def test_fit_ignores_pairs_of_weight_zero():
    rng = np.random.default_rng(1)
    x = rng.normal(size=(20, 3))
    T = pose(random_rotation(rng), rng.normal(size=3))
    y = apply(T, x)
    y[:5] += 100
    weights = np.r_[np.zeros(5), np.full(15, 2.0)]
    np.testing.assert_allclose(fit(x, y, weights), T, atol=1e-12)
    assert rotation_error(fit(x, y), T) > 1


def test_fit_is_the_minimum_of_the_weighted_squares():
    rng = np.random.default_rng(2)
    x, y = rng.normal(size=(2, 30, 3))
    w = rng.uniform(size=30)

    def cost(T):
        return float(w @ ((apply(T, x) - y) ** 2).sum(axis=1))

    best = fit(x, y, w)
    for _ in range(100):
        nudge = pose(axis_rotation(rng.normal(size=3), 0.01), 0.01 * rng.normal(size=3))
        assert cost(nudge @ best) > cost(best)


def test_fit_never_mirrors():
    x = np.random.default_rng(3).normal(size=(10, 3))
    flat = x * [1, 1, 0]
    for mirrored in (x * [1, 1, -1], flat * [1, -1, 1]):
        assert np.linalg.det(fit(x, mirrored)[:3, :3]) == pytest.approx(1)


def test_random_rotations_are_rotations_and_spread_over_all_of_them():
    rng = np.random.default_rng(4)
    R = np.array([random_rotation(rng) for _ in range(4000)])
    np.testing.assert_allclose(
        R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (4000, 1, 1)), atol=1e-12
    )
    angles = np.array([rotation_error(np.eye(3), r) for r in R])
    # even on SO(3): the share with an angle up to a is (a - sin a) / pi; 0.03 is 4 sigma
    for a in (np.pi / 3, np.pi / 2, 2.5):
        assert np.mean(np.radians(angles) < a) == pytest.approx((a - np.sin(a)) / np.pi, abs=0.03)


def test_inverse_undoes():
    T = pose(axis_rotation(AXIS, 1.0), np.array([4.0, 5, 6]))
    np.testing.assert_allclose(inverse(T) @ T, np.eye(4), atol=1e-14)
