"""Normal equations of the robust point-to-plane sum, by its derivatives, and steps with them."""

import numpy as np
import pytest

from mpe_core.geometry.cell_list import CellList
from mpe_core.kernels.motion_equations import EQUATION_SUMS
from mpe_core.kernels.plane_descent import find_nearest, mark_unknown, step_on_planes
from mpe_core.kernels.plane_equations import add_equations, solve_allowed, sum_equations
from mpe_core.kernels.rigid_motion import update_pose

CUTOFF, REACH = 0.2, 0.5


@pytest.fixture(scope="module")
def fixed():
    """Cell list of points, with a unit normal each."""
    rng = np.random.default_rng(0)
    cells = CellList(rng.normal(size=(2000, 3)).astype(np.float32), REACH)
    normals = rng.normal(size=(2000, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return cells, normals.astype(np.float32)


@pytest.fixture(scope="module")
def moving():
    """Points, some of which are out of reach, and their outward normals."""
    rng = np.random.default_rng(1)
    points, outward = rng.normal(0, 1.5, (600, 3)), rng.normal(size=(600, 3))
    return points.astype(np.float32), outward.astype(np.float32)


def no_columns(count, points):
    """Columns (count, N) and anchors (count, N, 4) before the first step."""
    shape = count, len(points)
    return np.full(shape, -1, np.int32), np.full((*shape, 4), -1, np.float32)


def nearest_planes(fixed, moving, T=None, last=None):
    """(1, N) columns next to the points at a pose."""
    cells, _ = fixed
    nearest, anchors = last or no_columns(1, moving[0])
    poses = np.eye(4)[None] if T is None else T[None]
    find_nearest(poses, np.array([0]), nearest, anchors, moving[0], cells.reach, cells.arrays)
    return nearest


def total(fixed, moving):
    cells, normals = fixed
    nearest, planes = nearest_planes(fixed, moving)[0], (cells.points, normals)
    parts, middle = np.empty((2, EQUATION_SUMS)), len(nearest) // 3
    for part, bounds in zip(parts, ((0, middle), (middle, len(nearest))), strict=True):
        sum_equations(np.eye(4), nearest, moving, planes, np.float32(CUTOFF), *bounds, part)
    return add_equations(parts)


def match(fixed, moving):
    """Points (n, 3) that have a plane, its point (n, 3) and its normal (n, 3), by trying all."""
    cells, normals = fixed
    points, outward = moving
    distances = np.linalg.norm(points[:, None] - cells.points, axis=2)
    k = distances.argmin(axis=1)
    near = distances.min(axis=1) < cells.reach
    if len(outward):
        near &= np.einsum("ni,ni->n", normals[k], outward) >= 0
    assert 50 < near.sum() < len(points) - 50
    return (a[near].astype(float) for a in (points, cells.points[k], normals[k]))


def test_they_are_the_weighted_sums_over_the_points_that_face_their_plane(fixed, moving):
    points, nearest, normals = match(fixed, moving)
    d = np.einsum("ni,ni->n", nearest - points, normals)
    w = np.where(np.abs(d) < CUTOFF, (1 - (d / CUTOFF) ** 2) ** 2, 0)
    assert 0 < (w == 0).sum() < len(w)
    J = np.hstack([np.cross(points, normals), normals])
    H, g = total(fixed, moving)
    np.testing.assert_allclose(H, J.T @ (w[:, None] * J), rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(g, J.T @ (w * d), rtol=1e-4, atol=1e-3)


def test_the_right_side_is_the_slope_of_tukeys_biweight(fixed, moving):
    points, nearest, normals = match(fixed, (moving[0], moving[1][:0]))

    def cost(step):
        moved = points + np.cross(step[:3], points) + step[3:]
        u = np.minimum((np.einsum("ni,ni->n", nearest - moved, normals) / CUTOFF) ** 2, 1)
        return (CUTOFF**2 / 6 * (1 - (1 - u) ** 3)).sum()

    _, g = total(fixed, (moving[0], moving[1][:0]))
    h = 1e-4
    slope = [(cost(h * e) - cost(-h * e)) / (2 * h) for e in np.eye(6)]
    np.testing.assert_allclose(-g, slope, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("step", [0.1, 0.02, 0.002, 0.0])
def test_the_columns_of_the_last_steps_change_nothing_but_time(fixed, moving, step):
    rng, T, last = np.random.default_rng(4), np.eye(4), no_columns(1, moving[0])
    first = nearest_planes(fixed, moving, T, last).copy()
    for _ in range(20):
        update_pose(T, rng.normal(0, step, 6))
        moved = nearest_planes(fixed, moving, T, last)
        np.testing.assert_array_equal(moved, nearest_planes(fixed, moving, T))
    assert (moved != first).any() == (step > 0)


def test_a_point_that_stays_in_place_is_not_looked_up_again(fixed, moving):
    columns, anchors = no_columns(1, moving[0])
    found = nearest_planes(fixed, moving, last=(columns, anchors)).copy()
    columns[:] = -7
    kept = nearest_planes(fixed, moving, last=(columns, anchors))
    is_kept = kept == -7
    assert is_kept.mean() > 0.9
    np.testing.assert_array_equal(kept[~is_kept], found[~is_kept])


def test_unknown_planes_are_those_that_the_given_poses_ask_for():
    nearest = np.array([[4, -1, 2, 4], [3, 3, 0, 1], [5, 0, -1, 2]], np.int32)
    is_known = np.array([True, False, False, False, False, False])
    np.testing.assert_array_equal(mark_unknown(nearest, np.array([0, 2]), is_known), [2, 4, 5])
    np.testing.assert_array_equal(is_known, [True, False, True, False, True, True])
    assert len(mark_unknown(nearest, np.array([0, 2]), is_known)) == 0


def test_a_step_keeps_to_the_allowed_motions(fixed, moving):
    basis = np.linalg.qr(np.random.default_rng(2).normal(size=(6, 3)))[0]
    H, g = total(fixed, moving)
    expected = basis @ np.linalg.solve(basis.T @ H @ basis, basis.T @ g)
    solve_allowed(H, g, basis @ basis.T)
    np.testing.assert_allclose(g, expected, rtol=1e-5, atol=1e-9)


def test_steps_lead_some_of_the_poses_to_the_minimum():
    """A curved sheet, off by less than the cut-off, comes back to where it lay."""
    x, y = np.random.default_rng(3).uniform(-1, 1, (2, 3000))
    sheet = np.column_stack([x, y, 0.3 * np.sin(3 * x + y) + 0.2 * x * y]).astype(np.float32)
    cells = CellList(sheet, 0.15)
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, 3] = [[0.01, 0, 0.03], [5, 5, 5], [0.02, -0.02, 0]]
    moving = cells.points, np.empty((0, 3), np.float32)
    planes = cells.points, cells.planes(cells.points).normals
    rows, (nearest, anchors) = np.array([0, 2]), no_columns(3, cells.points)
    cutoffs, sizes = np.full(2, 0.05, np.float32), []
    for _ in range(50):
        find_nearest(poses, rows, nearest, anchors, cells.points, cells.reach, cells.arrays)
        sizes.append(step_on_planes(poses, rows, nearest, moving, planes, cutoffs, np.eye(6)))
    assert (sizes[0] > 1e-3).all()
    assert (sizes[-1] < 1e-6).all()
    np.testing.assert_allclose(poses[rows], np.tile(np.eye(4), (2, 1, 1)), atol=1e-5)
    np.testing.assert_array_equal(poses[1, :3, 3], 5)
