"""Cells over a ground that rays cross, counted by layer."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(
    "void(float64[:, ::1], float64[:, ::1], float64[::1], int64[::1], float64,"
    " Tuple((float64[:, ::1], int64[::1], float64)), float64[::1], int64[::1], int32[:, :, ::1])",
    cache=True,
)
def count_crossings(starts, offsets, ranges, steps, cell, ground, edges, corner, counts):
    """Count the samples of rays in each cell of each layer over the ground.

    Parameters
    ----------
    starts
        (N, 3) places where the rays start.
    offsets, ranges
        (N, 3) and (N,) end of each ray less its start, and its length.
    steps
        (N,) samples of each ray, one in the middle of each piece of length `cell`.
    cell
        Edge of the cells and length of the pieces.
    ground
        Heights (w, h) of the ground in cells of its own, inf where there is none; the index (2,)
        of the first of these, and their edge.
    edges
        (L + 1,) heights over the ground between the layers, in ascending order.
    corner
        (2,) index of the first cell that is counted.
    counts
        (L, W, H) samples, added to; those outside are left out.
    """
    lowest, first, ground_cell = ground
    layers, width, height = counts.shape
    for i in range(len(steps)):
        length = max(ranges[i], cell)
        for step in range(steps[i]):
            share = (step + 0.5) * cell / length
            x = starts[i, 0] + share * offsets[i, 0]
            y = starts[i, 1] + share * offsets[i, 1]
            gx = np.int64(np.floor(x / ground_cell)) - first[0]
            gy = np.int64(np.floor(y / ground_cell)) - first[1]
            if not (0 <= gx < lowest.shape[0] and 0 <= gy < lowest.shape[1]):
                continue
            over = starts[i, 2] + share * offsets[i, 2] - lowest[gx, gy]
            layer = -1
            while layer < layers and over > edges[layer + 1]:
                layer += 1
            cx = np.int64(np.floor(x / cell)) - corner[0]
            cy = np.int64(np.floor(y / cell)) - corner[1]
            if 0 <= layer < layers and 0 <= cx < width and 0 <= cy < height:
                counts[layer, cx, cy] += 1
