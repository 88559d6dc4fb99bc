"""Turns that lay the three directions of a box on each other."""

import numpy as np
import pytest

from mpe_core.clouds.preprocess import prepare_cloud
from mpe_core.geometry.rigid import apply, axis_rotation, pose
from mpe_core.search.box_turns import box_turns
from tests.factories.clouds import knot

R = axis_rotation(np.array([1.0, -2.0, 0.5]), 0.9)


def carton(share_of_sides=1.0):
    """Points (N, 3) on the three faces of a carton that one side shows."""
    rng = np.random.default_rng(0)
    faces = []
    for axis in range(3):
        count = 8000 if axis == 2 else int(8000 * share_of_sides)
        points = rng.uniform(0, (1.0, 0.7, 0.5), (count, 3))
        points[:, axis] = 0
        faces.append(points)
    return np.concatenate(faces) - [0.5, 0.35, 0.25]


def turns_of(points):
    return box_turns(prepare_cloud(points).surface)


@pytest.fixture(scope="module")
def turns():
    return turns_of(carton() @ R.T)


def test_they_are_all_turns_of_a_cube_but_none_at_all(turns):
    assert turns.shape == (23, 3, 3)
    inside = np.einsum("ji,kjl,lm->kim", R, turns, R)
    np.testing.assert_allclose(np.abs(inside).max(axis=2), 1, atol=0.02)
    np.testing.assert_allclose(np.linalg.det(turns), 1, atol=1e-9)
    signed = {tuple(np.rint(Q).astype(int).ravel()) for Q in inside}
    assert len(signed) == 23
    assert tuple(np.eye(3, dtype=int).ravel()) not in signed


def test_they_turn_with_the_cloud(turns):
    other = axis_rotation(np.array([0.3, 1.0, 1.0]), 2.0)
    moved = turns_of(apply(pose(other, np.ones(3)), carton() @ R.T) - 1)
    back = np.einsum("ji,kjl,lm->kim", other, moved, other)
    for Q in back:
        assert np.abs(turns - Q).max(axis=(1, 2)).min() < 0.03


@pytest.mark.parametrize(
    "points",
    [2 * knot(20_000, np.random.default_rng(1)), carton(share_of_sides=0.0)],
    ids=["rounded", "one plane"],
)
def test_what_has_no_three_directions_has_none(points):
    assert len(turns_of(points)) == 0
