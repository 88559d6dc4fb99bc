"""The closed eigenproblem against numpy's; the planes are tested with `geometry.cell_list`."""

import numpy as np
import pytest

from mpe_core.kernels.local_planes import smallest_eigenvector


@pytest.mark.parametrize("seed", range(20))
def test_eigenvector_and_eigenvalue_are_those_of_numpy(seed):
    A = np.random.default_rng(seed).normal(size=(3, 3))
    M = A @ A.T
    *axis, low = smallest_eigenvector(*M[np.triu_indices(3)])
    values, axes = np.linalg.eigh(M)
    assert low == pytest.approx(values[0], abs=1e-9 * values[2])
    assert abs(axes[:, 0] @ axis) == pytest.approx(1, abs=1e-6)


def test_a_ball_has_an_axis_of_length_one():
    *axis, low = smallest_eigenvector(2.0, 0.0, 0.0, 2.0, 0.0, 2.0)
    assert np.linalg.norm(axis) == 1
    assert low == 2
