"""Points into the cells of a grid: numbering, sorting and averaging.

The grid and the hash table are tuples of the types `GRID` and `TABLE` of `kernels.cell_list`.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.cell_list import GRID, TABLE, cell_key, find_slot

SMALL_TABLE_SLOTS = 2**12
"""First size of the table where cells hold many points; small enough for the cache."""

LARGE_TABLE_SLOTS = 2**18
"""First size of the table where most points have a cell of their own: doubling it costs more than
cache misses (docs/tuning.md)."""


@njit(f"{TABLE}(int64, int64)", cache=True)
def empty_table(count, max_slots):
    """Return an empty table for `count` cells, at most half full, or of `max_slots` slots."""
    size = 16
    while size < 2 * count and size < max_slots:
        size *= 2
    return np.full(size, np.int64(-1)), np.empty(size, np.int32)


@njit(f"{TABLE}(int64[::1])", cache=True)
def build_table(cells):
    """Return the table that maps the key cells[c] to c."""
    keys, numbers = empty_table(cells.shape[0], np.int64(2) ** 40)
    for c in range(cells.shape[0]):
        slot = find_slot(keys, cells[c], keys.shape[0] - 1)
        keys[slot] = cells[c]
        numbers[slot] = c
    return keys, numbers


@njit(f"{TABLE}({TABLE})", cache=True)
def double_table(table):
    """Return a copy of the table with twice as many slots."""
    keys, numbers = table
    larger = np.full(2 * keys.shape[0], np.int64(-1))
    copied = np.empty(larger.shape[0], np.int32)
    for old in range(keys.shape[0]):
        if keys[old] != -1:
            slot = find_slot(larger, keys[old], larger.shape[0] - 1)
            larger[slot] = keys[old]
            copied[slot] = numbers[old]
    return larger, copied


@njit(
    f"UniTuple(int64, 2)(float32[:, ::1], {GRID}, {TABLE}, int32[::1], int32[::1], int64, int64)",
    cache=True,
)
def number_until_half_full(points, grid, table, cell_of, counts, row, cells):
    """Assign cell numbers to the points from a row on, until the table is half full.

    Writes the cell of each point into cell_of (N,) and the points of each cell into counts (N,).

    Returns
    -------
    The next row and the number of cells so far.
    """
    origin, size = grid
    keys, numbers = table
    inverse = np.float32(1.0) / size
    mask = keys.shape[0] - 1
    while row < points.shape[0] and 2 * cells <= mask:
        key = cell_key(
            np.int64((points[row, 0] - origin[0]) * inverse),
            np.int64((points[row, 1] - origin[1]) * inverse),
            np.int64((points[row, 2] - origin[2]) * inverse),
        )
        slot = find_slot(keys, key, mask)
        if keys[slot] == -1:
            keys[slot] = key
            numbers[slot] = cells
            cells += 1
        cell_of[row] = numbers[slot]
        counts[numbers[slot]] += 1
        row += 1
    return row, cells


@njit(
    f"Tuple(({TABLE}, int32[::1], int32[::1]))(float32[:, ::1], {GRID}, int64)",
    cache=True,
)
def number_cells(points, grid, max_slots):
    """Assign numbers to the occupied cells, in the order in which points (N, 3) meet them.

    Parameters
    ----------
    points, grid
        The cloud and its grid.
    max_slots
        Largest first size of the table, which doubles whenever it is half full.

    Returns
    -------
    The table, the cell (N,) of each point, and the points (cells,) in each cell.
    """
    n = points.shape[0]
    table = empty_table(n, max_slots)
    cell_of = np.empty(n, np.int32)
    counts = np.zeros(n, np.int32)
    row, cells = number_until_half_full(points, grid, table, cell_of, counts, 0, 0)
    while row < n:
        table = double_table(table)
        row, cells = number_until_half_full(points, grid, table, cell_of, counts, row, cells)
    return table, cell_of, counts[:cells]


@njit(f"float32[:, ::1](float32[:, ::1], {GRID})", cache=True)
def cell_means(points, grid):
    """Return the (cells, 3) means of the points in each occupied cell."""
    _, cell_of, counts = number_cells(points, grid, LARGE_TABLE_SLOTS)
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


@njit(f"float32[:, ::1](float32[:, ::1], int64[::1], {GRID})", cache=True, parallel=True)
def bucket_cell_means(points, bounds, grid):
    """Return `cell_means` of points sorted by bucket, one bucket a task.

    Bucket b holds the rows bounds[b]:bounds[b + 1]; no cell has points in two buckets.
    """
    buckets = bounds.shape[0] - 1
    if buckets == 1:  # another thread would not help, and wait for this one
        return cell_means(points, grid)
    means = np.empty((points.shape[0], 3), np.float32)
    cells = np.zeros(buckets, np.int64)
    for b in prange(buckets):
        found = cell_means(points[bounds[b] : bounds[b + 1]], grid)
        cells[b] = found.shape[0]
        means[bounds[b] : bounds[b] + cells[b]] = found
    all_means = np.empty((cells.sum(), 3), np.float32)
    place = 0
    for b in range(buckets):
        all_means[place : place + cells[b]] = means[bounds[b] : bounds[b] + cells[b]]
        place += cells[b]
    return all_means


@njit(f"Tuple((int64[::1], int32[::1], int32[::1]))(float32[:, ::1], {GRID})", cache=True)
def sort_cells(points, grid):
    """Sort the occupied cells of points (N, 3) by their keys.

    Returns
    -------
    Keys (cells,), points in each (cells,), and rows (N,) of the points cell by cell.
    """
    table, cell_of, counts = number_cells(points, grid, SMALL_TABLE_SLOTS)
    keys, numbers = table
    cells = counts.shape[0]
    key_of = np.empty(cells, np.int64)
    for slot in range(keys.shape[0]):
        if keys[slot] != -1:
            key_of[numbers[slot]] = keys[slot]
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
    f"Tuple((int64[::1], int32[::1], int32[::1]))(float32[:, ::1], int64[::1], {GRID})",
    cache=True,
    parallel=True,
)
def sort_bucket_cells(points, bounds, grid):
    """Sort the cells of points that are sorted by bucket, one bucket a task.

    Bucket b holds the rows bounds[b]:bounds[b + 1]; no cell has points in two buckets.

    Returns
    -------
    Keys (cells,), starts (cells + 1,) of the cells in the rows, and rows (N,) cell by cell.
    """
    n, buckets = points.shape[0], bounds.shape[0] - 1
    if buckets == 1:  # as in `bucket_cell_means`
        keys, counts, rows = sort_cells(points, grid)
        starts = np.zeros(len(counts) + 1, np.int32)
        starts[1:] = np.cumsum(counts)
        return keys, starts, rows
    keys, counts, rows = np.empty(n, np.int64), np.empty(n, np.int32), np.empty(n, np.int32)
    cells = np.zeros(buckets, np.int64)
    for b in prange(buckets):
        first, last = bounds[b], bounds[b + 1]
        bucket_keys, bucket_counts, bucket_rows = sort_cells(points[first:last], grid)
        cells[b] = bucket_keys.shape[0]
        keys[first : first + cells[b]] = bucket_keys
        counts[first : first + cells[b]] = bucket_counts
        rows[first:last] = bucket_rows + np.int32(first)
    all_keys, starts = np.empty(cells.sum(), np.int64), np.zeros(cells.sum() + 1, np.int32)
    c = 0
    for b in range(buckets):
        for k in range(bounds[b], bounds[b] + cells[b]):
            all_keys[c] = keys[k]
            starts[c + 1] = starts[c] + counts[k]
            c += 1
    return all_keys, starts, rows
