"""Matches and conflicts between two clouds seen from above, at the shifts of small windows.

A window holds EDGE x EDGE shifts. What a cell meets at all of them is one integer of 64 bits, and
64 counters are kept as the planes of their binary digits, so that a cell is counted at all shifts
in a few operations (Harley and Seal's carry-save adders, in Warren 2012). Clouds are given as in
`layer_shifts`.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from mpe_core.kernels.layer_shifts import CELLS, SOURCE, turn_source

EDGE = 8
"""Shifts along a side of a window."""

PLANES = 14
"""Binary digits of a counter: cells up to 16,383 are counted."""

MASKS = "uint64[:, :, ::1]"
TARGET = f"Tuple(({MASKS}, {MASKS}, int64[:, ::1]))"
"""Masks of the cells that are occupied or beside an occupied one, and of those that are clear, see
`window_masks`, and the occupied cells (M, 3), layer first."""


@njit(f"{MASKS}({CELLS})", cache=True)
def window_masks(table):
    """Pack the EDGE x EDGE cells from each cell on into one integer.

    Parameters
    ----------
    table
        (layers, n, m) cells, 0 or 1; all others are 0.

    Returns
    -------
    (layers, n + EDGE - 1, m + EDGE - 1) masks: bit EDGE i + j of the mask
    (layer, EDGE - 1 + x, EDGE - 1 + y) is the cell (layer, x + i, y + j).
    """
    layers, rows, columns = table.shape
    before = EDGE - 1
    masks = np.empty((layers, rows + before, columns + before), np.uint64)
    padded = np.zeros(columns + 2 * before, np.uint8)
    bits = np.empty(columns + before, np.uint8)
    for a in range(layers):
        for x in range(rows + before - 1, -1, -1):
            bits[:] = 0
            if x >= before:
                padded[before : before + columns] = table[a, x - before]
                for j in range(EDGE):
                    shifted = padded[j : j + len(bits)]
                    for y in range(len(bits)):
                        bits[y] |= shifted[y] << j
            for y in range(len(bits)):
                masks[a, x, y] = bits[y]
            if x + 1 < rows + before:
                for y in range(len(bits)):
                    masks[a, x, y] |= masks[a, x + 1, y] << np.uint64(EDGE)
    return masks


@njit("UniTuple(uint64, 2)(uint64, uint64, uint64)", cache=True, inline="always")
def add_bits(a, b, c):
    """Return the carries and the sums of three bits, for each of 64 places."""
    either = a ^ b
    return (a & b) | (either & c), either ^ c


@njit(f"void(int64[:, ::1], int64, int64, int64, {MASKS}, uint64[::1], int64[::1])", cache=True)
def add_hits(cells, sign, row, column, masks, planes, hits):
    """Add to hits (EDGE^2,) how many of the cells (K, 3) meet marked ones, at all shifts.

    At the shift (i, j), a cell (layer, x, y) meets the one at (row + sign x + i,
    column + sign y + j) of its layer. `planes` (PLANES,) is overwritten.
    """
    rows, columns, before = masks.shape[1], masks.shape[2], EDGE - 1
    planes[:] = 0
    ones = twos = fours = np.uint64(0)
    met = np.empty(8, np.uint64)
    for begin in range(0, len(cells), 8):
        met[:] = 0
        for k in range(begin, min(begin + 8, len(cells))):
            x, y = row + sign * cells[k, 1] + before, column + sign * cells[k, 2] + before
            if 0 <= x < rows and 0 <= y < columns:
                met[k - begin] = masks[cells[k, 0], x, y]
        twos_a, ones = add_bits(ones, met[0], met[1])
        twos_b, ones = add_bits(ones, met[2], met[3])
        fours_a, twos = add_bits(twos, twos_a, twos_b)
        twos_a, ones = add_bits(ones, met[4], met[5])
        twos_b, ones = add_bits(ones, met[6], met[7])
        fours_b, twos = add_bits(twos, twos_a, twos_b)
        carry, fours = add_bits(fours, fours_a, fours_b)
        plane = 3
        while carry != 0:
            planes[plane], carry = planes[plane] ^ carry, planes[plane] & carry
            plane += 1
    planes[0], planes[1], planes[2] = ones, twos, fours
    for shift in range(EDGE * EDGE):
        for plane in range(PLANES):
            hits[shift] += np.int64((planes[plane] >> np.uint64(shift)) & np.uint64(1)) << plane


@njit(
    f"Tuple((float64[:, ::1], int64[:, :, ::1]))(float64[::1], int64[::1], int64[:, ::1],"
    f" {SOURCE}, int64, float64, {TARGET}, int64, int64, float64[::1])",
    cache=True,
    parallel=True,
)
def best_shifts(
    turns, starts, corners, source, source_cells, size, target, target_cells, max_counted, weights
):
    """Find the best shift of the turned source over the target in each of some windows.

    Parameters
    ----------
    turns, source, source_cells, size, weights
        As those of `find_shifts`.
    starts
        (T + 1,) bounds of the windows of each turn.
    corners
        (W, 2) first shift of each window, in cells.
    target
        Cloud that stays, as `TARGET`.
    target_cells
        Cells along a side of its grid.
    max_counted
        As that of `find_shifts`, less than 2^PLANES.

    Returns
    -------
    Scores (W, C), and the shifts (W, C, 2) of the source's centre from the target's, in cells.
    """
    grown, clear, occupied = target
    layers, last = grown.shape[0], source_cells - 1
    offset = target_cells // 2 - source_cells // 2
    scores = np.empty((len(corners), len(weights)))
    shifts = np.empty((len(corners), len(weights), 2), np.int64)
    for turn in prange(len(turns)):
        moving, staying, turned, step = turn_source(
            turns[turn], size, source, source_cells, layers, occupied, max_counted
        )
        behind = window_masks(turned)
        planes = np.empty(PLANES, np.uint64)
        matches, conflicts = np.empty(EDGE * EDGE, np.int64), np.empty(EDGE * EDGE, np.int64)
        for window in range(starts[turn], starts[turn + 1]):
            row, column = corners[window, 0] + offset, corners[window, 1] + offset
            matches[:], conflicts[:] = 0, 0
            add_hits(moving, 1, row, column, grown, planes, matches)
            add_hits(moving, 1, row, column, clear, planes, conflicts)
            add_hits(staying, -1, row + last, column + last, behind, planes, conflicts)
            for kind in range(len(weights)):
                score = matches - weights[kind] * conflicts
                best = score.argmax()
                scores[window, kind] = step * score[best]
                shifts[window, kind, 0] = corners[window, 0] + best // EDGE
                shifts[window, kind, 1] = corners[window, 1] + best % EDGE
    return scores, shifts
