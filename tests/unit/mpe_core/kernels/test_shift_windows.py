"""Counts at the shifts of small windows against those at all shifts, and cell by cell."""

import numpy as np
import pytest

from mpe_core.kernels.layer_shifts import EVERY_LAYER, draw_layers, find_shifts, list_cells
from mpe_core.kernels.shift_windows import EDGE, PLANES, add_hits, best_shifts, window_masks

LAYERS, SIZE = 3, 0.5
WEIGHTS = np.array([1.0, 2.0])
SOURCE_CELLS, TARGET_CELLS, MAX_COUNTED = 14, 22, 6000


def cloud(seed, count, spread):
    """Points that stand in layers, and points that show what is clear."""
    rng = np.random.default_rng(seed)
    standing = rng.uniform(-spread, spread, (count, 2)), rng.integers(0, LAYERS, count)
    showing = rng.uniform(-spread, spread, (4 * count, 2)), np.full(4 * count, EVERY_LAYER)
    return *standing, *showing


def draw(points, cells):
    """Occupied, grown and clear cells."""
    return draw_layers(points, np.eye(2) / SIZE, np.full(2, float(cells // 2)), LAYERS, cells)


def shifted_scores(source, target, shift):
    """Scores of each weight at a shift in cells, by trying every cell."""
    occupied, _, clear = draw(source, SOURCE_CELLS)
    fixed_occupied, grown, fixed_clear = draw(target, TARGET_CELLS)

    def count(cells, table):
        place = cells[:, 1:] + shift + TARGET_CELLS // 2 - SOURCE_CELLS // 2
        inside = ((place >= 0) & (place < TARGET_CELLS)).all(axis=1)
        return int(table[cells[inside, 0], place[inside, 0], place[inside, 1]].sum())

    cells, free = np.argwhere(occupied), np.argwhere(clear)
    conflicts = count(cells, fixed_clear) + count(free, fixed_occupied)
    return count(cells, grown) - WEIGHTS * conflicts


def search(source, target, corners, turns=(0.0,)):
    occupied, grown, clear = draw(target, TARGET_CELLS)
    return best_shifts(
        np.array(turns),
        len(corners) * np.arange(len(turns) + 1),
        np.tile(np.array(corners), (len(turns), 1)),
        source,
        SOURCE_CELLS,
        SIZE,
        (window_masks(grown), window_masks(clear), list_cells(occupied)),
        TARGET_CELLS,
        MAX_COUNTED,
        WEIGHTS,
    )


def test_a_mask_holds_the_cells_from_its_own_on():
    table = (np.random.default_rng(0).random((2, 5, 11)) < 0.4).astype(np.uint8)
    around = np.pad(table, ((0, 0), (EDGE - 1, EDGE - 1), (EDGE - 1, EDGE - 1)))
    masks = window_masks(table)
    assert masks.shape == (2, 5 + EDGE - 1, 11 + EDGE - 1)
    for (layer, x, y), mask in np.ndenumerate(masks):
        bits = (int(mask) >> np.arange(EDGE * EDGE, dtype=object)) & 1
        expected = around[layer, x : x + EDGE, y : y + EDGE]
        np.testing.assert_array_equal(bits.reshape(EDGE, EDGE).astype(int), expected)


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 500, 2**PLANES - 1])
def test_every_cell_is_counted_once_at_every_shift_at_which_it_meets_a_marked_one(count):
    rng = np.random.default_rng(1)
    table = (rng.random((2, 12, 9)) < 0.5).astype(np.uint8)
    cells = rng.integers(0, (2, 14, 14), (count, 3))
    hits, expected = np.full(EDGE * EDGE, 5), np.full((EDGE, EDGE), 5)
    add_hits(cells, -1, 10, 6, window_masks(table), np.empty(PLANES, np.uint64), hits)
    at = np.add.outer([10, 6] - cells[:, 1:], np.arange(EDGE))
    x, y = at[:, 0, :, None], at[:, 1, None, :]
    inside = (x >= 0) & (x < 12) & (y >= 0) & (y < 9)
    met = table[cells[:, 0, None, None], np.clip(x, 0, 11), np.clip(y, 0, 8)]
    expected += (met * inside).sum(axis=0, dtype=np.int64)
    np.testing.assert_array_equal(hits.reshape(EDGE, EDGE), expected)


@pytest.mark.parametrize("corner", [(-4, -4), (3, -2), (-30, 4)])
def test_the_best_shift_is_that_of_trying_all(corner):
    source, target = cloud(2, 15, 2.5), cloud(3, 30, 4)
    scores, shifts = search(source, target, [corner])
    steps = [np.add(corner, (i, j)) for i in range(EDGE) for j in range(EDGE)]
    tried = np.array([shifted_scores(source, target, step) for step in steps])
    np.testing.assert_array_equal(scores[0], tried.max(axis=0))
    for kind in range(len(WEIGHTS)):
        assert shifted_scores(source, target, shifts[0, kind])[kind] == scores[0, kind]


def test_windows_find_the_best_of_all_shifts_at_each_turn():
    source, target, turns = cloud(4, 40, 2.5), cloud(5, 80, 4), (0.0, 0.7, 2.0)
    occupied, grown, clear = draw(target, TARGET_CELLS)
    fixed, reach = (grown, clear, list_cells(occupied)), EDGE - 1
    expected, _ = find_shifts(
        np.array(turns), reach, source, SOURCE_CELLS, SIZE, fixed, MAX_COUNTED, WEIGHTS, 1, 2
    )
    corners = [(i, j) for i in (-reach, 0) for j in (-reach, 0)]
    scores, _ = search(source, target, corners, turns)
    best = scores.reshape(len(turns), len(corners), -1).max(axis=1)
    np.testing.assert_array_equal(best, expected[:, :, 0])


def test_of_very_many_cells_some_are_counted_for_all():
    count, cells = 40 * MAX_COUNTED, 170
    rng = np.random.default_rng(6)
    full = rng.uniform(-40, 40, (count, 2)), rng.integers(0, LAYERS, count)
    points = *full, np.empty((0, 2)), np.empty(0, np.int64)
    occupied, grown, clear = draw(points, cells)
    listed = list_cells(occupied)
    assert len(listed) > 5 * MAX_COUNTED
    target = window_masks(grown), window_masks(clear), listed
    scores, _ = best_shifts(
        np.zeros(1),
        np.array([0, 1]),
        np.array([[-3, -3]]),
        points,
        cells,
        SIZE,
        target,
        cells,
        MAX_COUNTED,
        WEIGHTS,
    )
    assert scores[0, 0] == pytest.approx(len(listed), rel=0.01)
