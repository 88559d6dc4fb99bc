"""The descent on the P2 energy against sums written down."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpe_core.geometry.rigid import apply, pose
from mpe_core.kernels.distance_transform import nearest_point_index
from mpe_core.kernels.energy_descent import descend_poses, normal_equations
from mpe_core.kernels.motion_equations import BLOCK

EPS, TANGENTIAL_WEIGHT = 0.2, 0.05


@pytest.fixture(scope="module")
def target():
    return surface(400, 1)


def surface(count, seed):
    """Points in a ball with random normals and weights."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points, weights = rng.uniform(-1, 1, (count, 3)), rng.uniform(0.2, 1, count)
    return tuple(np.ascontiguousarray(a, np.float32) for a in (points, normals, weights))


@pytest.fixture(scope="module")
def lattice(target):
    origin, cell, shape = np.float32([-1.5, -1.5, -1.5]), np.float32(0.1), np.full(3, 30)
    return nearest_point_index(target[0], origin, cell, shape), origin, cell


@pytest.mark.parametrize("is_oriented", [False, True])
def test_normal_equations_are_the_sums_over_the_points(target, lattice, is_oriented):
    source = surface(2 * BLOCK + 22, 2)
    T = pose(Rotation.random(rng=3).as_matrix(), np.array([0.1, -0.2, 0.05]))
    H, g = np.zeros((6, 6)), np.zeros(6)
    score = normal_equations(
        T, source, target, lattice, np.float32(EPS**2), np.float32(TANGENTIAL_WEIGHT),
        is_oriented, H, g,
    )  # fmt: skip

    rows, origin, cell = lattice
    p = apply(T, source[0])
    i = np.clip(((p - origin) / cell).astype(int), 0, 29)
    j = rows[tuple(i.T)]
    y, n, w_target = (a[j].astype(float) for a in target)
    agree = np.einsum("ni,ni->n", n, source[1] @ T[:3, :3].T)
    agree = np.maximum(agree, 0) if is_oriented else agree
    pull = EPS**2 / (((y - p) ** 2).sum(axis=1) + EPS**2)
    scores = np.minimum(source[2], w_target) * agree**2 * pull
    assert score == pytest.approx(scores.sum(), rel=1e-4)
    expected_H, expected_g = np.zeros((6, 6)), np.zeros(6)
    for point, near, normal, w in zip(p, y, n, scores * pull, strict=True):
        x, a, b = point
        motions = np.hstack([-np.array([[0, -b, a], [b, 0, -x], [-a, x, 0]]), np.eye(3)])
        weight = np.outer(normal, normal) + TANGENTIAL_WEIGHT * np.eye(3)
        expected_H += w * motions.T @ weight @ motions
        expected_g += w * motions.T @ weight @ (near - point)
    np.testing.assert_allclose(np.tril(H), np.tril(expected_H), rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(g, expected_g, rtol=1e-3, atol=1e-4)


def test_poses_descend_each_on_its_own(target, lattice):
    turns = ([0, 0, angle] for angle in (0.0, 0.03, 2.0))
    starts = np.array([pose(Rotation.from_rotvec(w).as_matrix(), np.zeros(3)) for w in turns])

    def descended(poses):
        poses, scores = poses.copy(), np.empty(len(poses), np.float32)
        schedule = np.float32(0.2), np.float32(0.05), 15
        descend_poses(poses, scores, target, target, lattice, schedule, np.float32(0.05), False)
        return poses, scores

    poses, scores = descended(starts)
    for row in range(3):
        alone = descended(starts[row : row + 1])
        np.testing.assert_array_equal(alone[0][0], poses[row])
        assert alone[1][0] == scores[row]
    np.testing.assert_allclose(poses[:2, :3, :3], [np.eye(3)] * 2, atol=0.01)
    assert scores[2] < min(scores[:2]) <= 1
