"""The first point in each cubic cell, of a cloud that comes in pieces."""

from __future__ import annotations

import numpy as np
from numba import njit, types

EMPTY = 0
"""Key of a slot of the table that holds no cell."""
_MAX_CELL = 2.0**62
"""Largest index of a cell; points farther out share those at the end."""
_POINTS = types.Array(types.float64, 2, "C", readonly=True)


@njit("uint64(uint64, uint64)", cache=True, inline="always")
def _mix(key, number):
    key = (key ^ number) * np.uint64(0x9E3779B97F4A7C15)
    key ^= key >> np.uint64(29)
    key *= np.uint64(0xBF58476D1CE4E5B9)
    return key ^ (key >> np.uint64(32))


@njit(
    types.UniTuple(types.int64, 2)(
        _POINTS, types.int64, types.float64, types.uint64[::1], types.int64, types.boolean[::1]
    ),
    cache=True,
)
def mark_first(points, start, edge, table, room, is_first):
    """Mark the points that are the first in their cell, and enter the cells into the table.

    A cell is known by a hash of 64 bits: of ten million cells, two share one in a case of 400,000.

    Parameters
    ----------
    points : (N, 3) float64
        A piece of the cloud.
    start : int
        Row from which on points are looked at.
    edge : float
        Edge of the cells, a power of two: cells of twice the edge then consist of whole cells.
    table : (S,) uint64
        Cells seen so far, in a power of two of slots, more than are ever occupied.
    room : int
        New cells at which the loop stops.
    is_first : (N,) bool
        Set for each point that is looked at; points that are not finite are never first.

    Returns
    -------
    The row of the first point that was not looked at, and the number of new cells.
    """
    mask = np.uint64(table.shape[0] - 1)
    found, row = 0, start
    while row < points.shape[0]:
        key = np.uint64(1)
        is_finite = True
        for axis in range(3):
            place = np.floor(points[row, axis] / edge)
            if not np.isfinite(place):
                is_finite = False
                break
            place = min(max(place, -_MAX_CELL), _MAX_CELL)
            key = _mix(key, np.uint64(np.int64(place)))
        if not is_finite:
            is_first[row] = False
            row += 1
            continue
        if key == np.uint64(EMPTY):
            key = np.uint64(1)
        slot = key & mask
        while table[slot] != np.uint64(EMPTY) and table[slot] != key:
            slot = (slot + np.uint64(1)) & mask
        if table[slot] == key:
            is_first[row] = False
        elif found == room:
            return row, found
        else:
            table[slot] = key
            is_first[row] = True
            found += 1
        row += 1
    return row, found
