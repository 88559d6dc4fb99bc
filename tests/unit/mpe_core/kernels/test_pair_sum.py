"""The exact sum over all pairs against its plain twin."""

import numba
import numpy as np
import pytest

from mpe_core.geometry.rigid import apply, axis_rotation, pose
from mpe_core.paper.force_field import ExactField


def force_twin(x, y, eps, weights):
    """Eq. 7 written down: F_i = - sum_j m_j n_ij / (|x_i - y_j|^2 + eps^2)."""
    R = x[:, None] - y[None]
    r2 = (R**2).sum(axis=2)
    n = R / np.maximum(np.sqrt(r2), 1e-300)[:, :, None]
    return -(n * (weights / (r2 + eps**2))[:, :, None]).sum(axis=1)


@pytest.mark.parametrize("counts", [(1, 1), (5, 3), (300, 1024), (64, 1025), (200, 5000)])
@pytest.mark.parametrize("eps", [0.01, 0.3])
def test_force_is_the_double_sum(counts, eps):
    rng = np.random.default_rng(counts)
    x, y = rng.normal(size=(counts[0], 3)), rng.normal(size=(counts[1], 3))
    for given in (None, rng.lognormal(0, 3, counts[1])):
        weights = np.ones(counts[1]) if given is None else given
        exact = force_twin(x, y, eps, weights)
        # float32 rounds each pair to 1e-6 of itself: the bound is on the sum of the magnitudes
        scale = (weights / (((x[:, None] - y[None]) ** 2).sum(axis=2) + eps**2)).sum(axis=1)
        error = np.abs(ExactField(y, eps, given).force(x) - exact).max(axis=1)
        assert (error < 3e-6 * scale + 1e-6 * np.abs(exact).max()).all()


def test_one_pair_attracts_along_its_line():
    (force,) = ExactField(np.array([[2.0, 0, 0]]), 0.5).force(np.zeros((1, 3)))
    np.testing.assert_allclose(force, [1 / 4.25, 0, 0], rtol=1e-6, atol=1e-9)


def test_coincident_points_pull_not_at_all():
    np.testing.assert_array_equal(ExactField(np.ones((4, 3)), 0.1).force(np.ones((2, 3))), 0)


def test_action_is_reaction():
    rng = np.random.default_rng(5)
    x, y = rng.normal(size=(400, 3)), rng.normal(size=(700, 3)) + 1
    pull = ExactField(y, 0.1).force(x).sum(axis=0)
    np.testing.assert_allclose(ExactField(x, 0.1).force(y).sum(axis=0), -pull, rtol=1e-4)


def test_forces_turn_with_the_scene():
    rng = np.random.default_rng(6)
    x, y = rng.normal(size=(300, 3)), rng.normal(size=(400, 3))
    T = pose(axis_rotation(rng.normal(size=3), 2.0), np.zeros(3))
    turned = ExactField(apply(T, y), 0.2).force(apply(T, x))
    np.testing.assert_allclose(turned, apply(T, ExactField(y, 0.2).force(x)), atol=2e-3)


def test_the_bits_do_not_depend_on_the_threads():
    rng = np.random.default_rng(7)
    x, y = rng.normal(size=(3000, 3)), rng.normal(size=(3000, 3))
    before = numba.get_num_threads()
    results = []
    for threads in {1, before}:
        numba.set_num_threads(threads)
        results.append(ExactField(y, 0.1).force(x).tobytes())
    numba.set_num_threads(before)
    assert len(set(results)) == 1
