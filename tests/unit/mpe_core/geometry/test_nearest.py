"""Nearest rows against a k-d tree, for every way there is to find them."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from mpe_core.geometry.cell_list import MIN_BUCKETED_POINTS, count_occupied
from mpe_core.geometry.nearest import (
    DENSITY_CELL_EDGE,
    MIN_TREE_REACH,
    MIN_TWO_PASS_RATIO,
    POINTS_PER_CELL,
    NearestNeighbors,
    nearest_rows,
)
from tests.factories.clouds import bunny


@pytest.fixture(scope="module")
def cloud(data):
    model = bunny(data, "bun_zipper")
    unit = np.linalg.norm(model - model.mean(axis=0), axis=1).max()
    return (model - model.mean(axis=0)) / unit


@pytest.fixture(scope="module")
def dense(cloud):
    rng = np.random.default_rng(0)
    return np.vstack([cloud + rng.normal(size=cloud.shape, scale=0.002) for _ in range(8)])


@pytest.fixture(scope="module")
def dense_edge(dense):
    cells = count_occupied(dense.astype(np.float32), DENSITY_CELL_EDGE)
    return DENSITY_CELL_EDGE * np.sqrt(POINTS_PER_CELL * cells / len(dense))


def assert_nearest(queries, cloud, reach):
    row = nearest_rows(queries, cloud, reach)
    distance, nearest = KDTree(cloud).query(queries)
    at_the_edge = np.abs(distance - reach) < 2e-6
    np.testing.assert_array_equal((row >= 0)[~at_the_edge], (distance <= reach)[~at_the_edge])
    found = row >= 0
    assert found.any()
    assert not found.all()
    gap = np.linalg.norm(queries[found] - cloud[row[found]], axis=1)
    np.testing.assert_allclose(gap, distance[found], atol=1e-6)
    assert (row[found] == nearest[found]).mean() > 0.99


def around(cloud, count):
    """Queries at all distances, in random order."""
    rng = np.random.default_rng(1)
    rows = rng.permutation(len(cloud))[:count]
    spread = rng.choice([1e-4, 0.01, 0.1], (count, 1))
    return cloud[rows] + spread * rng.normal(size=(count, 3))


@pytest.mark.parametrize("reach", [0.002, 0.02, 0.09, 2 * MIN_TREE_REACH])
def test_nearest_rows_of_a_scan(cloud, reach):
    assert_nearest(around(cloud, 5000), cloud, reach)


@pytest.mark.parametrize("share", [0.2, 1.2, 1.1 * MIN_TWO_PASS_RATIO])
def test_nearest_rows_of_a_dense_cloud(dense, dense_edge, share):
    assert_nearest(around(dense, 5000), dense, share * dense_edge)


def test_many_queries_asked_cube_by_cube_come_back_in_their_order(dense, dense_edge):
    assert_nearest(around(dense, MIN_BUCKETED_POINTS), dense, 2 * dense_edge)


def test_nothing_within_reach(cloud):
    far = cloud[:100] + 10
    assert (nearest_rows(far, cloud, 0.01) == -1).all()
    assert (nearest_rows(far, cloud, 0.5) == -1).all()


def test_points_are_their_own_nearest_neighbors(cloud):
    distance, row = NearestNeighbors(cloud).nearest(cloud)
    assert not distance.any()
    np.testing.assert_array_equal(cloud[row], cloud)
    distance, row = NearestNeighbors(cloud).nearest(cloud + 9, reach=1.0)
    assert np.isinf(distance).all()
    assert (row == len(cloud)).all()
