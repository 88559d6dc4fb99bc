"""The closed eigenproblem against numpy's; the planes are tested with `geometry.cell_list`."""

import numpy as np
import pytest

from mpe_core.kernels.local_planes import smallest_eigenvectors


def _solve(matrices):
    """Axes (N, 3) and smallest eigenvalues (N,) of symmetric matrices (N, 3, 3)."""
    axes = np.empty((4, len(matrices)))
    rows, columns = np.triu_indices(3)
    smallest_eigenvectors(np.ascontiguousarray(matrices[:, rows, columns].T), axes)
    return axes[:3].T, axes[3]


@pytest.mark.parametrize("count", [1, 5, 64])
def test_eigenvectors_and_eigenvalues_are_those_of_numpy(count):
    A = np.random.default_rng(count).normal(size=(count, 3, 3))
    matrices = A @ A.transpose(0, 2, 1)
    axes, low = _solve(matrices)
    values, vectors = np.linalg.eigh(matrices)
    assert np.all(np.abs(low - values[:, 0]) <= 1e-9 * values[:, 2])
    assert np.abs(np.einsum("ni,ni->n", axes, vectors[:, :, 0])) == pytest.approx(1, abs=1e-6)


def test_a_ball_has_an_axis_of_length_one():
    axes, low = _solve(np.stack([np.eye(3), 2 * np.eye(3), np.zeros((3, 3))]))
    assert np.linalg.norm(axes, axis=1).tolist() == [1, 1, 1]
    assert low.tolist() == [1, 2, 0]
