"""Numbers, order and means of cells against numpy's `unique`."""

import numpy as np
import pytest

from mpe_core.kernels.cell_list import cell_key, find_slot
from mpe_core.kernels.cell_table import build_table, cell_means, number_cells, sort_cells

EDGE = np.float32(0.1)


@pytest.fixture(scope="module")
def points():
    return np.random.default_rng(0).uniform(0, 1, (3000, 3)).astype(np.float32)


@pytest.fixture(scope="module")
def grid():
    return np.zeros(3, np.float32), EDGE


@pytest.fixture(scope="module")
def cells(points):
    """(N, 3) the cell of each point."""
    return (points * (np.float32(1) / EDGE)).astype(int)


@pytest.mark.parametrize("max_slots", [16, 2**18])
def test_cells_are_numbered_in_the_order_of_their_first_points(points, grid, cells, max_slots):
    (keys, numbers), cell_of, counts = number_cells(points, grid, max_slots)
    _, first, inverse = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    number = np.argsort(np.argsort(first))
    np.testing.assert_array_equal(cell_of, number[inverse.ravel()])
    np.testing.assert_array_equal(counts, np.bincount(cell_of))
    assert (keys != -1).sum() == len(counts) <= len(keys) / 2 + 1
    for cell, expected in zip(cells[:50], cell_of[:50], strict=True):
        slot = find_slot(keys, cell_key(*cell), len(keys) - 1)
        assert numbers[slot] == expected


def test_a_table_finds_its_keys_and_no_others():
    cells = np.unique(np.random.default_rng(1).integers(0, 2**60, 500))
    keys, numbers = build_table(cells)
    assert [numbers[find_slot(keys, key, len(keys) - 1)] for key in cells] == list(
        range(len(cells))
    )
    assert keys[find_slot(keys, cells.max() + 1, len(keys) - 1)] == -1


def test_sorted_cells_ascend_and_keep_the_order_of_their_points(points, grid, cells):
    keys, counts, rows = sort_cells(points, grid)
    key = np.array([cell_key(*cell) for cell in cells])
    np.testing.assert_array_equal(rows, np.argsort(key, kind="stable"))
    expected = np.unique(key, return_counts=True)
    np.testing.assert_array_equal(keys, expected[0])
    np.testing.assert_array_equal(counts, expected[1])


def test_means_are_those_of_the_points_of_each_cell(points, grid):
    _, cell_of, counts = number_cells(points, grid, 2**12)
    sums = [np.bincount(cell_of, column) for column in points.T.astype(float)]
    np.testing.assert_allclose(cell_means(points, grid), (sums / counts).T, rtol=1e-6)
