"""Counts of matches and conflicts against counts cell by cell."""

import numpy as np
import pytest

from mpe_core.kernels.layer_shifts import (
    EVERY_LAYER,
    find_shifts,
    grow_cells,
    list_cells,
    mark_cells,
)

LAYERS, SIZE, RADIUS = 2, 0.5, 2
WEIGHTS = np.array([1.0, 2.0])
MAX_COUNTED = 6000


def draw(xy, layer, cells):
    grid = np.zeros((LAYERS, cells, cells), np.uint8)
    mark_cells(xy, layer, np.eye(2) / SIZE, np.full(2, float(cells // 2)), grid)
    return grid


def draw_all(standing, showing, cells):
    """Occupied, grown and clear cells."""
    occupied = draw(*standing, cells)
    grown = np.zeros_like(occupied)
    grow_cells(occupied, grown)
    return occupied, grown, draw(*showing, cells) & ~grown


def cloud(seed, count, spread):
    """Points that stand in layers, and points that show what is clear."""
    rng = np.random.default_rng(seed)
    standing = rng.uniform(-spread, spread, (count, 2)), rng.integers(0, LAYERS, count)
    showing = rng.uniform(-spread, spread, (4 * count, 2)), np.full(4 * count, EVERY_LAYER)
    return standing, showing


def shifted_scores(moving, fixed, shift, offset):
    """Scores of each weight at a shift in cells, by trying every cell."""
    occupied, _, clear = moving
    fixed_occupied, grown, fixed_clear = fixed

    def count(cells, table):
        place = cells[:, 1:] + shift + offset
        inside = ((place >= 0) & (place < table.shape[1])).all(axis=1)
        return int(table[cells[inside, 0], place[inside, 0], place[inside, 1]].sum())

    cells, free = np.argwhere(occupied), np.argwhere(clear)
    conflicts = count(cells, fixed_clear) + count(free, fixed_occupied)
    return count(cells, grown) - WEIGHTS * conflicts


def search(source, target, reach, peaks, *, turns=(0.0,)):
    moving, fixed = draw_all(*source, 14), draw_all(*target, 20)
    scores, shifts = find_shifts(
        np.array(turns),
        reach,
        (*source[0], *source[1]),
        14,
        SIZE,
        (fixed[1], fixed[2], list_cells(fixed[0])),
        MAX_COUNTED,
        WEIGHTS,
        peaks,
        RADIUS,
    )
    return moving, fixed, scores, shifts


def test_cells_grow_within_their_layer():
    grid = np.zeros((2, 5, 5), np.uint8)
    grid[0, 0, 2] = grid[1, 3, 3] = 1
    grown = np.zeros_like(grid)
    grow_cells(grid, grown)
    expected = np.zeros_like(grid)
    expected[0, :2, 1:4] = expected[1, 2:, 2:] = 1
    np.testing.assert_array_equal(grown, expected)
    np.testing.assert_array_equal(list_cells(grid), np.argwhere(grid))


def test_the_best_shift_is_that_of_trying_all():
    source, target = cloud(0, 15, 2.5), cloud(1, 30, 4)
    moving, fixed, scores, shifts = search(source, target, 4, 1)
    steps = [(i, j) for i in range(-4, 5) for j in range(-4, 5)]
    tried = np.array([shifted_scores(moving, fixed, step, 10 - 7) for step in steps])
    np.testing.assert_array_equal(scores[0, :, 0], tried.max(axis=0))
    for kind in range(len(WEIGHTS)):
        found = shifted_scores(moving, fixed, shifts[0, kind, 0], 10 - 7)
        assert found[kind] == scores[0, kind, 0]


def test_a_turned_and_shifted_copy_is_found_at_its_turn_and_shift():
    (xy, layer), _ = cloud(2, 25, 2.5)
    c, s = np.cos(0.7), np.sin(0.7)
    moved = xy @ np.array([[c, s], [-s, c]]) + SIZE * np.array([2, -3])
    nothing = np.empty((0, 2)), np.empty(0, np.int64)
    turns = (0.0, 0.7, -0.7)
    _, _, scores, shifts = search(
        ((xy, layer), nothing), ((moved, layer), nothing), 5, 1, turns=turns
    )
    assert scores[:, 0, 0].argmax() == 1
    # occupied cells meet the neighbours of occupied ones, too
    np.testing.assert_allclose(shifts[1, 0, 0], [2, -3], atol=1)


def test_peaks_are_apart_and_fall():
    _, _, scores, shifts = search(cloud(3, 15, 2.5), cloud(4, 30, 4), 6, 5)
    assert (np.diff(scores[0, 0]) <= 0).all()
    apart = np.abs(shifts[0, 0][:, None] - shifts[0, 0]).max(axis=2)
    assert (apart[~np.eye(5, dtype=bool)] > RADIUS).all()


def test_of_very_many_cells_some_are_counted_for_all():
    rng = np.random.default_rng(5)
    full = rng.uniform(-40, 40, (40 * MAX_COUNTED, 2)), rng.integers(0, LAYERS, 40 * MAX_COUNTED)
    nothing = np.empty((0, 2)), np.empty(0, np.int64)
    cells = 170
    occupied = draw(*full, cells)
    grown = np.zeros_like(occupied)
    grow_cells(occupied, grown)
    listed = list_cells(occupied)
    assert len(listed) > 5 * MAX_COUNTED
    scores, _ = find_shifts(
        np.zeros(1),
        2,
        (*full, *nothing),
        cells,
        SIZE,
        (grown, np.zeros_like(grown), listed),
        MAX_COUNTED,
        WEIGHTS,
        1,
        RADIUS,
    )
    assert scores[0, 0, 0] == pytest.approx(len(listed), rel=0.01)
