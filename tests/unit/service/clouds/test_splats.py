"""Gaussian splats look the same from the other side of a rotation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from service.clouds.quaternions import multiply, to_quaternion
from service.clouds.splats import _harmonics, rotate_splats

RNG = np.random.default_rng(2)
R = Rotation.from_euler("xyz", [20, -50, 130], degrees=True).as_matrix()


def test_the_axes_of_splats_turn() -> None:
    quaternions = Rotation.random(30, random_state=1)
    columns = np.roll(quaternions.as_quat(), 1, axis=1).T * 2.5  # not normalised, as in training
    names = [f"rot_{i}" for i in range(4)]
    turned = rotate_splats(dict(zip(names, columns.astype(np.float32), strict=True)), R)
    table = np.stack([turned[name] for name in names], axis=1)
    assert table.dtype == np.float32
    found = Rotation.from_quat(np.roll(table, -1, axis=1)).as_matrix()
    np.testing.assert_allclose(found, R @ quaternions.as_matrix(), atol=1e-5)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_colours_of_splats_turn(degree: int) -> None:
    """The colour seen along a direction is that seen along the turned direction afterwards."""
    size = (degree + 1) ** 2 - 1
    table = RNG.normal(size=(20, 3 * size))
    attributes = {f"f_rest_{i}": table[:, i] for i in range(3 * size)}
    turned = rotate_splats(attributes, R)
    after = np.stack([turned[name] for name in attributes], axis=1).reshape(20, 3, size)
    directions = RNG.normal(size=(9, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    seen = table.reshape(20, 3, size) @ _harmonics(directions)[:, :size].T
    np.testing.assert_allclose(after @ _harmonics(directions @ R.T)[:, :size].T, seen, atol=1e-9)


def test_other_attributes_are_no_splats() -> None:
    assert rotate_splats({"rot_0": np.zeros(3), "f_rest_0": np.zeros(3)}, R) == {}


@pytest.mark.parametrize("angles", [(0, 0, 0), (180, 0, 0), (0, 180, 0), (120, -35, 77)])
def test_quaternions_are_those_of_scipy(angles: tuple[float, float, float]) -> None:
    first = Rotation.from_euler("xyz", angles, degrees=True)
    quaternion = to_quaternion(first.as_matrix())
    back = Rotation.from_quat(np.roll(quaternion, -1))
    np.testing.assert_allclose(back.as_matrix(), first.as_matrix(), atol=1e-12)
    product = multiply(quaternion, to_quaternion(R))
    found = Rotation.from_quat(np.roll(product, -1)).as_matrix()
    np.testing.assert_allclose(found, first.as_matrix() @ R, atol=1e-12)
