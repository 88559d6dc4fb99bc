"""Bounds, sums and moments per task against numpy's in one piece."""

import numpy as np
import pytest

from mpe_core.kernels.bounds import (
    ROWS_PER_TASK,
    bounding_box,
    center_and_scale,
    task_extents,
    task_scatter,
)


@pytest.fixture(params=[1, ROWS_PER_TASK, 2 * ROWS_PER_TASK + 5])
def points(request):
    return np.random.default_rng(request.param).normal(3, 2, (request.param, 3))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_box_holds_the_points_and_no_more(points, dtype):
    points = points.astype(dtype)
    points.flags.writeable = False
    np.testing.assert_array_equal(bounding_box(points), [points.min(axis=0), points.max(axis=0)])
    assert bounding_box(points).dtype == dtype


def test_extents_of_the_tasks_are_those_of_their_rows(points):
    points.flags.writeable = False  # a caller's memory map
    parts = task_extents(points)
    assert len(parts) == -(-len(points) // ROWS_PER_TASK)
    for part, start in zip(parts, range(0, len(points), ROWS_PER_TASK), strict=True):
        rows = points[start : start + ROWS_PER_TASK].astype(float)
        np.testing.assert_array_equal(part[0], rows.min(axis=0))
        np.testing.assert_array_equal(part[1], rows.max(axis=0))
        offsets = (rows - points[0]).sum(axis=0)
        np.testing.assert_allclose(part[2], offsets, rtol=1e-5, atol=1e-3 * len(rows) ** 0.5)


def test_scatter_is_the_sum_of_outer_squares(points):
    center = np.array([1.0, -2, 3])
    v = (points - center) / 2.5
    np.testing.assert_allclose(
        task_scatter(points, center, 2.5).sum(axis=0), v.T @ v, rtol=1e-10, atol=1e-10
    )


def test_points_are_centered_and_scaled(points):
    out, center = np.empty_like(points), np.array([1.0, -2, 3])
    center_and_scale(points, center, 2.5, out)
    np.testing.assert_array_equal(out, (points - center) / 2.5)
