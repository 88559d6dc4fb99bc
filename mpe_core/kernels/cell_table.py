"""Points into the cells of a grid: numbered, sorted, averaged."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.cell_list import cell_key, find_slot

FEW_CELLS = 2**12
"""Slots of a table to begin with where few points have a cell of their own, but no more than hold
all of them: it stays at most half full, and small enough for the processor's cache."""

MANY_CELLS = 2**18
"""Likewise where most points have one. 40,000 points of the bunny thinned to 32,000: 0.46 ms with
2**17 slots, 1.4 with 2**12 that double; a million to 100,000: 12 ms and 15."""


@njit("Tuple((int64[::1], int32[::1]))(int64, int64)", cache=True)
def empty_table(count, most):
    """Keys and slots for `count` cells, or `most` slots."""
    size = 16
    while size < 2 * count and size < most:
        size *= 2
    return np.full(size, np.int64(-1)), np.empty(size, np.int32)


@njit("Tuple((int64[::1], int32[::1]))(int64[::1])", cache=True)
def table_of(cells):
    """The table in which cell c has the key cells[c]."""
    keys, slots = empty_table(cells.shape[0], np.int64(2) ** 40)
    for c in range(cells.shape[0]):
        slot = find_slot(keys, cells[c], keys.shape[0] - 1)
        keys[slot] = cells[c]
        slots[slot] = c
    return keys, slots


@njit("Tuple((int64[::1], int32[::1]))(int64[::1], int32[::1])", cache=True)
def doubled(keys, slots):
    """The table in twice its size."""
    larger = np.full(2 * keys.shape[0], np.int64(-1))
    numbers = np.empty(larger.shape[0], np.int32)
    for old in range(keys.shape[0]):
        if keys[old] != -1:
            slot = find_slot(larger, keys[old], larger.shape[0] - 1)
            larger[slot] = keys[old]
            numbers[slot] = slots[old]
    return larger, numbers


@njit(
    "UniTuple(int64, 2)(float32[:, ::1], float32[::1], float32, int64[::1], int32[::1], int32[::1],"
    " int32[::1], int64, int64)",
    cache=True,
)
def number_until_half_full(points, origin, size, keys, slots, cell_of, counts, i, cells):
    """Number the cells of the points from row i on until the table is half full: (next row, number
    of cells)."""
    inverse = np.float32(1.0) / size
    mask = keys.shape[0] - 1
    while i < points.shape[0] and 2 * cells <= mask:
        key = cell_key(
            np.int64((points[i, 0] - origin[0]) * inverse),
            np.int64((points[i, 1] - origin[1]) * inverse),
            np.int64((points[i, 2] - origin[2]) * inverse),
        )
        slot = find_slot(keys, key, mask)
        if keys[slot] == -1:
            keys[slot] = key
            slots[slot] = cells
            cells += 1
        cell_of[i] = slots[slot]
        counts[slots[slot]] += 1
        i += 1
    return i, cells


@njit(
    "Tuple((int64[::1], int32[::1], int32[::1], int32[::1]))"
    "(float32[:, ::1], float32[::1], float32, int64)",
    cache=True,
)
def number_cells(points, origin, size, most_slots):
    """Number the occupied cells in order of first appearance: (keys, slots, cell of point,
    counts), in a table that has up to `most_slots` to begin with."""
    n = points.shape[0]
    keys, slots = empty_table(n, most_slots)
    cell_of = np.empty(n, np.int32)
    counts = np.zeros(n, np.int32)
    i, cells = number_until_half_full(points, origin, size, keys, slots, cell_of, counts, 0, 0)
    while i < n:
        keys, slots = doubled(keys, slots)
        i, cells = number_until_half_full(
            points, origin, size, keys, slots, cell_of, counts, i, cells
        )
    return keys, slots, cell_of, counts[:cells]


@njit("float32[:, ::1](float32[:, ::1], float32[::1], float32)", cache=True)
def cell_means(points, origin, size):
    """Mean of the points of each occupied cell."""
    _, _, cell_of, counts = number_cells(points, origin, size, MANY_CELLS)
    sums = np.zeros((counts.shape[0], 3), np.float64)
    for i in range(points.shape[0]):
        c = cell_of[i]
        sums[c, 0] += points[i, 0]
        sums[c, 1] += points[i, 1]
        sums[c, 2] += points[i, 2]
    means = np.empty((counts.shape[0], 3), np.float32)
    for c in range(counts.shape[0]):
        for a in range(3):
            means[c, a] = sums[c, a] / counts[c]
    return means


@njit(
    "float32[:, ::1](float32[:, ::1], int64[::1], float32[::1], float32)", cache=True, parallel=True
)
def means_of_buckets(points, bounds, origin, size):
    """`cell_means` of points of which bucket b holds bounds[b]:bounds[b + 1] and no cell lies in
    two."""
    buckets = bounds.shape[0] - 1
    means = np.empty((points.shape[0], 3), np.float32)
    cells = np.zeros(buckets, np.int64)
    for b in prange(buckets):
        found = cell_means(points[bounds[b] : bounds[b + 1]], origin, size)
        cells[b] = found.shape[0]
        means[bounds[b] : bounds[b] + cells[b]] = found
    all_means = np.empty((cells.sum(), 3), np.float32)
    place = 0
    for b in range(buckets):
        all_means[place : place + cells[b]] = means[bounds[b] : bounds[b] + cells[b]]
        place += cells[b]
    return all_means


@njit(
    "Tuple((int64[::1], int32[::1], int32[::1]))(float32[:, ::1], float32[::1], float32)",
    cache=True,
)
def sorted_cells(points, origin, size):
    """The occupied cells by their keys: (keys, counts, rows of the points cell by cell)."""
    keys, slots, cell_of, counts = number_cells(points, origin, size, FEW_CELLS)
    cells = counts.shape[0]
    key_of = np.empty(cells, np.int64)
    for slot in range(keys.shape[0]):
        if keys[slot] != -1:
            key_of[slots[slot]] = keys[slot]
    order = np.argsort(key_of)
    place = np.empty(cells, np.int32)
    start = 0
    for c in order:
        place[c] = start
        start += counts[c]
    rows = np.empty(points.shape[0], np.int32)
    for i in range(points.shape[0]):
        c = cell_of[i]
        rows[place[c]] = i
        place[c] += 1
    return key_of[order], counts[order], rows


@njit(
    "Tuple((int64[::1], int32[::1], int32[::1]))"
    "(float32[:, ::1], int64[::1], float32[::1], float32)",
    cache=True,
    parallel=True,
)
def cells_of_buckets(points, bounds, origin, size):
    """`sorted_cells` of points of which bucket b holds bounds[b]:bounds[b + 1] and no cell lies in
    two: (keys, where each cell starts and the last one ends, rows)."""
    n, buckets = points.shape[0], bounds.shape[0] - 1
    keys, counts, rows = np.empty(n, np.int64), np.empty(n, np.int32), np.empty(n, np.int32)
    cells = np.zeros(buckets, np.int64)
    for b in prange(buckets):
        first, last = bounds[b], bounds[b + 1]
        some, count, row = sorted_cells(points[first:last], origin, size)
        cells[b] = some.shape[0]
        keys[first : first + cells[b]] = some
        counts[first : first + cells[b]] = count
        rows[first:last] = row + np.int32(first)
    all_keys, starts = np.empty(cells.sum(), np.int64), np.zeros(cells.sum() + 1, np.int32)
    c = 0
    for b in range(buckets):
        for k in range(bounds[b], bounds[b] + cells[b]):
            all_keys[c] = keys[k]
            starts[c + 1] = starts[c] + counts[k]
            c += 1
    return all_keys, starts, rows
