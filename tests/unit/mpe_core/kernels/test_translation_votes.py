"""Translation votes against the histogram of all differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpe_core.kernels.translation_votes import (
    BINS_PER_EDGE,
    best_translations,
    direction_bin,
    take_fullest_block,
)

BINS = 3 * BINS_PER_EDGE**2


def lines(count):
    return Rotation.random(count, rng=5).as_matrix()[:, 0].astype(np.float32)


def test_a_line_has_one_bin_whichever_way_it_points():
    bins = np.array([direction_bin(*line) for line in lines(2000)])
    np.testing.assert_array_equal(bins, [direction_bin(*-line) for line in lines(2000)])
    assert set(bins) == set(range(BINS))


@pytest.mark.parametrize("seed", range(4))
def test_the_fullest_block_of_eight_cells_is_found_and_the_histogram_emptied(seed):
    nx, ny, nz = 4, 5, 6
    counts = np.random.default_rng(seed).integers(0, 50, (nx, ny, nz))
    counts[-1] = counts[:, -1] = counts[:, :, -1] = 0
    row, plane = nz, ny * nz
    histogram = np.zeros(counts.size + plane + row + 2, np.uint16)
    histogram[: counts.size] = counts.ravel()
    cell, most = take_fullest_block(histogram, row, plane)
    windows = np.lib.stride_tricks.sliding_window_view(counts, (2, 2, 2)).sum(axis=(3, 4, 5))
    assert most == windows.max()
    first = np.unravel_index(np.argmax(windows), windows.shape)
    assert cell == np.ravel_multi_index(first, counts.shape)
    assert not histogram.any()


def test_an_empty_histogram_has_no_block():
    assert take_fullest_block(np.zeros(2 * 20 + 4 + 2, np.uint16), 4, 20) == (0, 0)


def vote(target_bins):
    """Votes of 20 points on 30, the target's points listed in the bins of (30, bins)."""
    rng = np.random.default_rng(6)
    source, target = (rng.uniform(-1, 1, (n, 3)).astype(np.float32) for n in (20, 30))
    cell, half = np.float32(0.25), np.full(3, 16, np.int64)
    width = 2 * half + 1
    numbers = np.floor(target / cell).astype(np.int64) @ [width[1] * width[2], width[2], 1]
    listed = [numbers[target_bins[:, b]] for b in range(BINS)]
    starts = np.concatenate([[0], np.cumsum([len(some) for some in listed])])
    rotations = Rotation.random(12, rng=7).as_matrix().astype(np.float32)
    normals = lines(20)
    cells = np.concatenate(listed).astype(np.int32), starts
    translations, votes = best_translations(rotations, (source, normals), cells, cell, half)
    return source, normals, target, cell, rotations, translations, votes


@pytest.mark.parametrize("share", [1.0, 0.3])
def test_votes_are_the_histogram_of_all_differences(share):
    listed = np.random.default_rng(8).random((30, BINS)) < share
    source, normals, target, cell, rotations, translations, votes = vote(listed)
    for R, t, most in zip(rotations, translations, votes, strict=True):
        turned = np.floor(source @ R.T / cell).astype(int)
        agrees = listed[:, [direction_bin(*(R @ normal)) for normal in normals]]
        differences = (np.floor(target / cell).astype(int)[:, None] - turned)[agrees]
        corner = np.round(t / cell - 0.5).astype(int)

        def count(at, differences=differences):
            return ((differences >= at) & (differences <= at + 1)).all(axis=1).sum()

        assert count(corner) == most
        assert max(count(at) for at in np.unique(differences, axis=0)) <= most
