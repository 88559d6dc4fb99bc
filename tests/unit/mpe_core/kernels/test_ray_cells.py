"""Cells that rays cross, against a count of numpy's."""

import numpy as np

from mpe_core.kernels.ray_cells import count_crossings

CELL, GROUND_CELL = 0.1, 0.4
EDGES = np.array([0.1, 0.3, 0.8])


def count(viewpoint, ends, lowest, corner, shape):
    offsets = ends - viewpoint
    ranges = np.linalg.norm(offsets, axis=1)
    steps = (ranges / CELL).astype(np.int64)
    counts = np.zeros(shape, np.int32)
    ground = lowest, np.zeros(2, np.int64), GROUND_CELL
    starts = np.tile(viewpoint, (len(ends), 1))
    count_crossings(starts, offsets, ranges, steps, CELL, ground, EDGES, corner, counts)
    samples = np.concatenate(
        [
            viewpoint + (np.arange(n) + 0.5)[:, None] * CELL / r * o
            for n, r, o in zip(steps, ranges, offsets, strict=True)
        ]
    )
    return counts, samples


def test_a_level_ray_crosses_each_cell_of_its_row_once():
    viewpoint = np.array([0.0, 0.05, 0.2])
    counts, _ = count(
        viewpoint,
        viewpoint + np.array([[1.0, 0, 0]]),
        np.zeros((3, 3)),
        np.zeros(2, int),
        (2, 12, 3),
    )
    expected = np.zeros((2, 12, 3), int)
    expected[0, :10, 0] = 1
    np.testing.assert_array_equal(counts, expected)


def test_samples_are_counted_by_cell_and_by_height_over_the_ground():
    rng = np.random.default_rng(0)
    lowest = rng.uniform(0, 0.3, (6, 6))
    lowest[2, 3] = np.inf  # no ground is near
    corner = np.array([-2, 3])
    counts, x = count(np.full(3, 1.2), rng.uniform(-0.5, 3, (600, 3)), lowest, corner, (2, 20, 15))
    at = np.floor(x[:, :2] / GROUND_CELL).astype(int)
    inside = ((at >= 0) & (at < 6)).all(axis=1)
    x, at = x[inside], at[inside]
    layer = np.searchsorted(EDGES, x[:, 2] - lowest[at[:, 0], at[:, 1]]) - 1
    cell = np.floor(x[:, :2] / CELL).astype(int) - corner
    used = (layer >= 0) & (layer < 2) & ((cell >= 0) & (cell < (20, 15))).all(axis=1)
    expected = np.zeros((2, 20, 15), int)
    np.add.at(expected, (layer[used], cell[used, 0], cell[used, 1]), 1)
    assert used.sum() > 500
    np.testing.assert_array_equal(counts, expected)
