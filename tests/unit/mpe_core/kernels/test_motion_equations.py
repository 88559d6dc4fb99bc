"""Normal equations of six unknowns against numpy."""

import numpy as np

from mpe_core.kernels.motion_equations import EQUATION_SUMS, solve_cholesky, unpack_equations


def test_sums_are_the_upper_triangle_and_the_right_side():
    sums = np.random.default_rng(0).normal(size=EQUATION_SUMS)
    H, g = np.empty((6, 6)), np.empty(6)
    unpack_equations(sums, H, g)
    np.testing.assert_array_equal(H[np.triu_indices(6)], sums[:21])
    np.testing.assert_array_equal(H, H.T)
    np.testing.assert_array_equal(g, sums[21:])


def test_cholesky_solves_what_is_positive_definite():
    rng = np.random.default_rng(0)
    A, b = rng.normal(size=(6, 6)), rng.normal(size=6)
    H, x = A @ A.T, b.copy()
    assert solve_cholesky(np.tril(H), x)
    np.testing.assert_allclose(H @ x, b, atol=1e-8)
    assert not solve_cholesky(H - 2 * np.linalg.eigvalsh(H)[3] * np.eye(6), b)
