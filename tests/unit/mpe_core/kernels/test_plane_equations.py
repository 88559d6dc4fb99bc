"""Normal equations of the robust point-to-plane sum against its derivatives."""

import numpy as np
import pytest

from mpe_core.kernels.plane_equations import ROWS_PER_TASK, plane_equations

CUTOFF = 0.3


@pytest.fixture(scope="module")
def rows():
    """Points, correspondences, normals, and which rows count."""
    rng, n = np.random.default_rng(0), ROWS_PER_TASK + 100
    points = rng.normal(size=(n, 3))
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    nearest = points + rng.normal(0, 0.2, (n, 3))
    single = (a.astype(np.float32) for a in (points, nearest, normals))
    return *single, rng.random(n) < 0.8


def total(rows):
    H, g = plane_equations(*rows, np.float32(CUTOFF))
    return H.sum(axis=0), g.sum(axis=0)


def test_they_are_the_weighted_sums_over_the_valid_rows(rows):
    points, nearest, normals, valid = (a[rows[3]].astype(float) for a in rows)
    assert valid.all()
    d = np.einsum("ni,ni->n", nearest - points, normals)
    w = np.where(np.abs(d) < CUTOFF, (1 - (d / CUTOFF) ** 2) ** 2, 0)
    assert 0 < (w == 0).sum() < len(w)
    J = np.hstack([np.cross(points, normals), normals])
    H, g = total(rows)
    np.testing.assert_allclose(H, J.T @ (w[:, None] * J), rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(g, J.T @ (w * d), rtol=1e-4, atol=1e-3)


def test_the_right_side_is_the_slope_of_tukeys_biweight(rows):
    points, nearest, normals, _ = (a[rows[3]].astype(float) for a in rows)

    def cost(step):
        moved = points + np.cross(step[:3], points) + step[3:]
        u = np.minimum((np.einsum("ni,ni->n", nearest - moved, normals) / CUTOFF) ** 2, 1)
        return (CUTOFF**2 / 6 * (1 - (1 - u) ** 3)).sum()

    _, g = total(rows)
    h = 1e-4
    slope = [(cost(h * e) - cost(-h * e)) / (2 * h) for e in np.eye(6)]
    np.testing.assert_allclose(-g, slope, rtol=1e-3, atol=1e-3)
