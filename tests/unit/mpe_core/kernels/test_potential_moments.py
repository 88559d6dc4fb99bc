"""Moments of the full-sum potential against the plain sums."""

import numpy as np

from mpe_core.kernels.potential_moments import potential_moments


def test_moments_are_the_plain_sums():
    rng = np.random.default_rng(1)
    x, y, eps = rng.normal(size=(7, 3)), rng.normal(size=(50, 3)), 0.3
    out = np.empty((7, 11), np.float32)
    columns = (np.ascontiguousarray(a.T, dtype=np.float32) for a in (x, y))
    potential_moments(*columns, np.float32(eps), out)
    d = y - x[:, None]
    u = 1 / (np.sum(d**2, axis=2) + eps**2)
    upper = np.triu_indices(3)
    expected = np.column_stack(
        [
            u.sum(axis=1),
            (u**2).sum(axis=1),
            np.einsum("nm,nmi->ni", u**2, d),
            np.einsum("nm,nmi,nmj->nij", u**3, d, d)[:, upper[0], upper[1]],
        ]
    )
    np.testing.assert_allclose(out, expected, rtol=2e-4, atol=2e-4)
