"""Steps of the direction to points in a row, and how they change with the place."""

import numpy as np
import pytest

from mpe_core.kernels.equal_steps import step_equations, step_lengths, unequal_steps


@pytest.fixture
def triples():
    rng = np.random.default_rng(0)
    return rng.normal(size=(40, 1, 3)) + 0.1 * rng.normal(size=(40, 3, 3)) + [0, 0, 6]


def test_equal_steps_of_the_direction_differ_by_nothing():
    place, turn = np.array([1.0, 2, 3]), np.array([0.1, 0.2, 0.3])
    regular = np.column_stack([np.sin(turn), np.zeros(3), np.cos(turn)]) * [[2.0], [5.0], [1.0]]
    skipped = regular.copy()
    skipped[2] = 7 * np.array([np.sin(0.4), 0, np.cos(0.4)])
    seen = np.stack([regular, skipped]) + place
    differences = unequal_steps(seen, place[None])[0]
    assert differences[0] < 0.11  # a turn by equal angles bends by its own size
    assert differences[1] == pytest.approx(2 / 3, abs=0.02)


def test_the_equations_are_the_slope_of_the_loss_while_the_sum_of_the_steps_is_held(triples):
    scale, place = 0.4, np.array([0.3, -0.2, 0.1])

    def directions(at):
        rays = triples - at
        return rays / np.linalg.norm(rays, axis=2)[:, :, None]

    steps = np.linalg.norm(np.diff(directions(place), axis=1), axis=2).sum(axis=1)

    def loss(at):
        second = np.diff(directions(at), n=2, axis=1)[:, 0]
        squares = np.square(2 * second / steps[:, None]).sum(axis=1)
        return (squares / (squares + scale**2)).sum()

    differences = unequal_steps(triples, place[None])[0] ** 2
    assert loss(place) == pytest.approx((differences / (differences + scale**2)).sum())
    (H,), (g,) = step_equations(triples, place[None], scale)
    h = 1e-6
    slope = [(loss(place + h * e) - loss(place - h * e)) / (2 * h) for e in np.eye(3)]
    np.testing.assert_allclose(-2 / scale**2 * g, slope, rtol=1e-4, atol=1e-6)
    assert np.all(np.linalg.eigvalsh(H) > 0)


@pytest.mark.parametrize("count", [3, 50])
def test_lengths_and_changes_of_the_steps_are_those_of_differences(count):
    points = np.random.default_rng(count).normal(size=(count, 3))
    steps, changes = step_lengths(points)
    np.testing.assert_allclose(steps, np.linalg.norm(np.diff(points, axis=0), axis=1))
    np.testing.assert_allclose(changes, np.linalg.norm(np.diff(points, n=2, axis=0), axis=1))
