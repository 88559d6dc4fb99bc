"""Rigid motions."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpe_core.geometry.rigid import (
    apply,
    axis_rotation,
    cross_matrix,
    fit,
    inverse,
    pose,
    rotation_between,
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


def test_the_cross_matrix_is_the_cross_product():
    a, p = np.random.default_rng(4).normal(size=(2, 5, 3))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", cross_matrix(a), p), np.cross(a, p))
    np.testing.assert_array_equal(cross_matrix(a[0]), cross_matrix(a)[0])


@pytest.mark.parametrize("angle", [0.0, 1e-6, 1.0, np.pi])
def test_axis_rotation_is_that_of_a_rotation_vector(angle):
    expected = Rotation.from_rotvec(angle * AXIS / np.linalg.norm(AXIS)).as_matrix()
    np.testing.assert_allclose(axis_rotation(AXIS, angle), expected, atol=1e-15)


@pytest.mark.parametrize("scale", [1.0, 0.7, 1000.0])
def test_inverse_undoes(scale):
    T = pose(scale * axis_rotation(AXIS, 1.0), np.array([4.0, 5, 6]))
    np.testing.assert_allclose(inverse(T) @ T, np.eye(4), atol=1e-14)


def test_vectors_that_differ_by_less_than_a_square_holds_need_no_turn():
    z = np.array([0.0, 0.0, 1.0])
    np.testing.assert_array_equal(rotation_between(z, np.array([1e-200, 0.0, 1.0])), np.eye(3))
