"""Matches and conflicts between two clouds seen from above, at many turns and shifts.

Cells lie in layers. Only occupied ones are counted, which are few:

- `SOURCE`: positions (N, 2) about the centre and layers (N,) of the points that stand in a layer,
  and of those that show what is clear.
- `TARGET`: grids (layers, n, n) of the cells that are occupied or beside an occupied one, and of
  those that are clear, about the centre; and the occupied cells (M, 3), layer first.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

BLOCK, MAX_BYTE = 32, 255
"""Cells that are counted at once, and the largest count of a byte."""

EVERY_LAYER = -1

CELLS = "uint8[:, :, ::1]"
SOURCE = "Tuple((float64[:, ::1], int64[::1], float64[:, ::1], int64[::1]))"
TARGET = f"Tuple(({CELLS}, {CELLS}, int64[:, ::1]))"


@njit(f"void(float64[:, ::1], int64[::1], float64[:, ::1], float64[::1], {CELLS})", cache=True)
def mark_cells(xy, layer, A, b, grid):
    """Mark the cells of the places A x + b, in cells, of points x (N, 2); those outside are left.

    Parameters
    ----------
    xy, layer
        (N, 2) positions and (N,) layers; EVERY_LAYER marks a cell of all of them.
    A, b
        (2, 2) turn over the edge of a cell, and (2,) shift in cells.
    grid
        (layers, n, n) cells, which become 1 where a point lies, and are left otherwise.
    """
    rows, columns = grid.shape[1], grid.shape[2]
    for i in range(len(xy)):
        x = A[0, 0] * xy[i, 0] + A[0, 1] * xy[i, 1] + b[0]
        y = A[1, 0] * xy[i, 0] + A[1, 1] * xy[i, 1] + b[1]
        if 0 <= x < rows and 0 <= y < columns:
            if layer[i] == EVERY_LAYER:
                grid[:, int(x), int(y)] = 1
            else:
                grid[layer[i], int(x), int(y)] = 1


@njit(f"void({CELLS}, {CELLS})", cache=True)
def grow_cells(grid, grown):
    """Mark in `grown` the cells of each layer that are marked or have a marked neighbour."""
    layers, rows, columns = grid.shape
    for a in range(layers):
        for x in range(rows):
            for y in range(columns):
                if grid[a, x, y]:
                    for i in range(max(x - 1, 0), min(x + 2, rows)):
                        for j in range(max(y - 1, 0), min(y + 2, columns)):
                            grown[a, i, j] = 1


@njit(f"UniTuple({CELLS}, 3)({SOURCE}, float64[:, ::1], float64[::1], int64, int64)", cache=True)
def draw_layers(cloud, A, b, layers, cells):
    """Draw a cloud, given as `SOURCE`, at the places A x + b, in cells.

    Returns
    -------
    Grids (layers, cells, cells): occupied cells; these and their neighbours; clear cells, which are
    shown and not among these.
    """
    standing, layer, showing, shown_layer = cloud
    occupied = np.zeros((layers, cells, cells), np.uint8)
    grown, clear = np.zeros_like(occupied), np.zeros_like(occupied)
    mark_cells(standing, layer, A, b, occupied)
    grow_cells(occupied, grown)
    mark_cells(showing, shown_layer, A, b, clear)
    for a in range(layers):
        for x in range(cells):
            for y in range(cells):
                if grown[a, x, y]:
                    clear[a, x, y] = 0
    return occupied, grown, clear


@njit(f"int64[:, ::1]({CELLS})", cache=True)
def list_cells(grid):
    """(K, 3) layers, rows and columns of the marked cells."""
    count = 0
    for cell in grid.flat:
        count += cell
    found, k = np.empty((count, 3), np.int64), 0
    for a in range(grid.shape[0]):
        for x in range(grid.shape[1]):
            for y in range(grid.shape[2]):
                if grid[a, x, y]:
                    found[k] = a, x, y
                    k += 1
    return found


@njit(f"uint8[:, ::1]({CELLS}, int64)", cache=True)
def join_rows(table, edge):
    """Join the rows of each layer of a table (layers, n, m) to one.

    There are `edge` empty cells before the first row and after each one, and a row of them and
    BLOCK more after the last: a window of `edge` shifts along a row never meets another row.
    """
    layers, rows, columns = table.shape
    width = columns + edge
    joined = np.zeros((layers, edge + (rows + 1) * width + BLOCK), np.uint8)
    for a in range(layers):
        for x in range(rows):
            first = edge + x * width
            joined[a, first : first + columns] = table[a, x]
    return joined


@njit(
    "uint16[:, ::1](int64[:, ::1], int64, int64, int64, uint8[:, ::1], int64, int64, int64)",
    cache=True,
    error_model="numpy",
)
def count_hits(cells, sign, row, column, joined, rows, columns, edge):
    """Count at all shifts of a window how many of the cells (K, 3) meet marked ones of a table.

    At the shift (i, j), both less than `edge`, a cell (layer, x, y) meets the one at
    (row + sign x + i, column + sign y + j) of its layer. The table (layers, rows, columns) is
    given as `join_rows` returns it, and all rows that a cell meets are added at once.
    """
    width = columns + edge
    hits = np.zeros((edge, edge), np.uint16)
    few = np.empty(edge * width + BLOCK, np.uint8)  # bytes are counted in larger vectors
    for begin in range(0, len(cells), MAX_BYTE):
        few[:] = 0
        for k in range(begin, min(begin + MAX_BYTE, len(cells))):
            x, y = row + sign * cells[k, 1], column + sign * cells[k, 2]
            first, last = max(0, -x), min(edge, rows - x)
            if first < last and -edge < y < columns:
                # whole vectors, without a rest that is counted cell by cell
                length = -(-(last - first) * width // BLOCK) * BLOCK
                start = edge + (x + first) * width + y
                met = joined[cells[k, 0], start : start + length]
                counted = few[first * width : first * width + length]
                for j in range(len(counted)):
                    counted[j] += met[j]
        for i in range(edge):
            for j in range(edge):
                hits[i, j] += few[i * width + j]
    return hits


@njit(
    "void(uint16[:, ::1], uint16[:, ::1], float64, int64, float64[::1], int64[:, ::1])", cache=True
)
def take_peaks(matches, conflicts, weight, radius, scores, shifts):
    """Take the shifts (P, 2) with the highest scores (P,), no two within `radius` of each other.

    The counts are those of `count_hits`.
    """
    height, width = matches.shape
    score, best = np.empty((height, width)), np.empty(height)
    for i in range(height):
        for j in range(width):
            score[i, j] = matches[i, j] - weight * conflicts[i, j]
        best[i] = score[i].max()
    for peak in range(len(scores)):
        row = best.argmax()
        column = score[row].argmax()
        scores[peak], shifts[peak, 0], shifts[peak, 1] = score[row, column], row, column
        for i in range(max(0, row - radius), min(height, row + radius + 1)):
            score[i, max(0, column - radius) : column + radius + 1] = -np.inf
            best[i] = score[i].max()


@njit(
    f"Tuple((int64[:, ::1], int64[:, ::1], {CELLS}, int64))(float64, float64, {SOURCE}, int64,"
    " int64, int64[:, ::1], int64)",
    cache=True,
)
def turn_source(turn, size, source, source_cells, layers, occupied, max_counted):
    """Draw the source turned about its centre, and choose the cells that are counted.

    Parameters
    ----------
    turn
        Turn in radians.
    size, source, source_cells, max_counted
        As those of `find_shifts`.
    layers
        Number of layers.
    occupied
        (M, 3) occupied cells of the target.

    Returns
    -------
    The source's occupied cells that are counted, and the target's; the source's clear cells, turned
    by half a turn: shifts run through them as through the target's tables; and how many cells each
    of the counted ones stands for.
    """
    c, s = np.cos(turn) / size, np.sin(turn) / size
    A, b = np.array([[c, -s], [s, c]]), np.full(2, float(source_cells // 2))
    cells, _, clear = draw_layers(source, A, b, layers, source_cells)
    moving = list_cells(cells)
    step = 1 + max(len(moving), len(occupied)) // max_counted
    return moving[::step].copy(), occupied[::step].copy(), clear[:, ::-1, ::-1].copy(), step


@njit(
    "Tuple((float64[:, :, ::1], int64[:, :, :, ::1]))(float64[::1], int64,"
    f" {SOURCE}, int64, float64, {TARGET}, int64, float64[::1], int64, int64)",
    cache=True,
    parallel=True,
)
def find_shifts(
    turns, reach, source, source_cells, size, target, max_counted, weights, peaks, radius
):
    """Find the best of all shifts of the turned source over the target.

    Parameters
    ----------
    turns
        (T,) turns of the source about its centre, in radians.
    reach
        Largest shift along an axis, in cells.
    source
        Cloud that moves, as `SOURCE`.
    source_cells
        Cells along a side of a grid around the source's centre.
    size
        Edge of a cell.
    target
        Cloud that stays, as `TARGET`.
    max_counted
        Occupied cells of either cloud that are counted: of more, every second or third is.
    weights
        (C,) weights of a conflict over a match.
    peaks, radius
        Shifts that are taken of each turn for each weight, and cells by which they are apart.

    Returns
    -------
    Scores (T, C, peaks), -inf where there is no other shift, and the shifts (T, C, peaks, 2) of
    the source's centre from the target's, in cells.
    """
    occupied, (layers, rows, _) = target[2], target[0].shape
    edge, last = 2 * reach + 1, source_cells - 1
    first = rows // 2 - source_cells // 2 - reach
    grown, clear = join_rows(target[0], edge), join_rows(target[1], edge)
    scores = np.empty((len(turns), len(weights), peaks))
    shifts = np.zeros((len(turns), len(weights), peaks, 2), np.int64)
    for turn in prange(len(turns)):
        moving, staying, turned, step = turn_source(
            turns[turn], size, source, source_cells, layers, occupied, max_counted
        )
        shown, at = join_rows(turned, edge), first + last
        matches = count_hits(moving, 1, first, first, grown, rows, rows, edge)
        conflicts = count_hits(moving, 1, first, first, clear, rows, rows, edge)
        conflicts += count_hits(staying, -1, at, at, shown, source_cells, source_cells, edge)
        for kind in range(len(weights)):
            take_peaks(
                matches, conflicts, weights[kind], radius, scores[turn, kind], shifts[turn, kind]
            )
        scores[turn] *= step
        shifts[turn] -= reach
    return scores, shifts
