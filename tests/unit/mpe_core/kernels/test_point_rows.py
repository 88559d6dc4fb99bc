"""Loops over rows against numpy's."""

import numpy as np

from mpe_core.geometry.rigid import pose
from mpe_core.kernels.point_rows import (
    correspondence_distances,
    gather_columns,
    restore_order,
    transform_points,
)

RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(100, 3))


def test_points_are_turned_and_moved():
    T, out = pose(np.diag([1.0, -1, -1]), np.array([1.0, 2, 3])), np.empty_like(POINTS)
    for points in (POINTS, POINTS.astype(np.float32)):
        transform_points(T, points, out)
        np.testing.assert_allclose(out, points @ T[:3, :3].T + T[:3, 3], atol=1e-12)


def test_columns_are_the_points_at_the_rows():
    points, rows = POINTS.astype(np.float32), RNG.permutation(100)[:40].astype(np.int32)
    out = np.empty((3, 40), np.float32)
    gather_columns(points, rows, out)
    np.testing.assert_array_equal(out, points[rows].T)


def test_answers_come_back_in_the_callers_rows_and_order():
    rows, order = (RNG.permutation(50).astype(np.int32) for _ in range(2))
    places = RNG.integers(-1, 50, 50).astype(np.int32)
    out = np.empty(50, np.int64)
    restore_order(places, rows, order, out)
    for place, query in zip(places, order, strict=True):
        assert out[query] == (rows[place] if place >= 0 else -1)


def test_distances_are_in_the_callers_unit_and_infinite_without_a_correspondence():
    rows, out = RNG.integers(-1, 100, 100), np.empty(100)
    correspondence_distances(POINTS, POINTS[::-1].copy(), rows, 2.5, out)
    expected = 2.5 * np.linalg.norm(POINTS - POINTS[::-1][rows], axis=1)
    np.testing.assert_allclose(out, np.where(rows >= 0, expected, np.inf))
