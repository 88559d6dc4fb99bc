"""Cell lists against a k-d tree and plain numpy."""

import numba
import numpy as np
import pytest
from scipy.spatial import KDTree

from mpe_core.geometry.cell_list import (
    MIN_BUCKETED_POINTS,
    CellList,
    bucket_order,
    fit_grid,
    voxel_downsample,
)
from tests.factories.clouds import bunny

REACH = 0.1


@pytest.fixture(scope="module")
def cloud(data):
    return bunny(data).astype(np.float32)


@pytest.fixture(scope="module")
def queries(cloud):
    rng = np.random.default_rng(1)
    near = cloud[::3] + rng.normal(size=cloud[::3].shape, scale=0.05)
    return np.vstack([near, rng.uniform(-3, 3, (500, 3))]).astype(np.float32)


def test_nearest_is_the_exact_nearest_within_reach(cloud, queries):
    cells = CellList(cloud, REACH)
    row, squared = cells.nearest(queries)
    distance, nearest = KDTree(cloud).query(queries)
    within = distance <= REACH
    np.testing.assert_array_equal(row >= 0, within)
    np.testing.assert_allclose(np.sqrt(squared[within]), distance[within], atol=1e-6)
    np.testing.assert_array_equal(cloud[cells.rows[row[within]]], cells.points[row[within]])
    assert (cells.rows[row[within]] == nearest[within]).mean() > 0.99
    assert np.isinf(squared[~within]).all()


def test_planes_are_those_of_numpy(cloud, queries):
    cells = CellList(cloud, REACH)
    planes = cells.planes(queries)
    for row, rows in enumerate(KDTree(cloud).query_ball_point(queries, REACH)):
        assert abs(planes.counts[row] - len(rows)) <= 1, (
            "a point at the very edge may fall either way"
        )
        if len(rows) < 8 or planes.counts[row] != len(rows):
            continue
        values, axes = np.linalg.eigh(np.cov(cloud[rows].astype(np.float64).T, bias=True))
        assert planes.plane_std[row] == pytest.approx(np.sqrt(values[0]), abs=2e-4)
        assert planes.surface_variation[row] == pytest.approx(values[0] / values.sum(), abs=2e-3)
        foot = planes.project(queries)[row] - cloud[rows].mean(axis=0)
        assert abs(foot @ planes.normals[row]) < 2e-5, "the plane runs through the mean"
        if values[1] > 3 * values[0]:
            assert abs(planes.normals[row] @ axes[:, 0]) > 0.999
    assert (planes.normals[planes.counts < 5] == 0).all()


@pytest.fixture(scope="module")
def large(cloud):
    """So many points that they are laid bucket by bucket."""
    rng = np.random.default_rng(2)
    rows = rng.permutation(np.arange(MIN_BUCKETED_POINTS + 1) % len(cloud))
    return (cloud[rows] + rng.normal(size=(len(rows), 3), scale=0.02)).astype(np.float32)


def test_buckets_hold_whole_cubes(large):
    origin, edge = fit_grid(large, 0.02)
    ordered, rows, bounds = bucket_order(large, (origin, edge))
    np.testing.assert_array_equal(ordered, large[rows])
    np.testing.assert_array_equal(np.sort(rows), np.arange(len(large)))
    cube = np.floor((ordered - origin) * (1 / edge)).astype(int)
    bucket = np.searchsorted(bounds, np.arange(len(large)), side="right")
    assert len(np.unique(bucket)) > 100
    cubes = np.unique(cube, axis=0)
    assert len(np.unique(np.column_stack([cube, bucket]), axis=0)) == len(cubes)


def test_the_bits_of_a_large_cloud_do_not_depend_on_threads(large):
    before, bits = numba.get_num_threads(), set()
    for threads in (1, before):
        numba.set_num_threads(threads)
        cells = CellList(large, 0.02)
        planes = cells.planes(large)
        nearest = cells.nearest_rows(large[::-1].copy())
        bits.add(
            voxel_downsample(large, 0.02).tobytes() + planes.normals.tobytes() + nearest.tobytes()
        )
    numba.set_num_threads(before)
    assert len(bits) == 1


def test_nearest_of_a_large_cloud_are_rows_as_given(large):
    queries = large[::-1] + np.float32(0.01)
    row = CellList(large, REACH).nearest_rows(queries)
    distance, nearest = KDTree(large).query(queries)
    np.testing.assert_array_equal(row >= 0, distance < REACH)
    np.testing.assert_allclose(np.linalg.norm(queries - large[row], axis=1), distance, atol=1e-6)
    assert (row == nearest).mean() > 0.99


@pytest.mark.parametrize("which", ["cloud", "large"])
def test_thinning_keeps_one_mean_a_cube(which, request):
    cloud, edge = request.getfixturevalue(which), 0.2
    means = voxel_downsample(cloud, edge)
    cube = np.floor((cloud - cloud.min(axis=0)) / np.float32(edge)).astype(int)
    _, member = np.unique(cube, axis=0, return_inverse=True)
    expected = np.array([cloud[member == k].mean(axis=0) for k in range(member.max() + 1)])
    assert len(means) == len(expected)
    distance, row = KDTree(expected).query(means)
    assert distance.max() < 1e-5
    assert len(set(row)) == len(means)


def test_a_cloud_too_wide_for_its_cubes_gets_larger_ones():
    wide = np.array([[0, 0, 0], [1e6, 1e6, 1e6], [1e6, 0, 0]], np.float32)
    cells = CellList(wide, 1e-3)
    assert cells.reach > 0.4
    row, squared = cells.nearest(wide)
    np.testing.assert_array_equal(cells.rows[row], [0, 1, 2])
    assert (squared == 0).all()
