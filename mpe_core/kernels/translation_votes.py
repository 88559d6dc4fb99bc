"""Translation votes: for a rotation R every pair of points (i, j) votes for t = y_j - R x_i."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

ROTATIONS_PER_TASK = 8
"""Rotations that share one histogram in memory."""
BINS_PER_EDGE = 4
"""Bins along an edge of the direction cube: 48 lines about 25 degrees apart."""

ORIENTED_POINTS = "Tuple((float32[:, ::1], float32[:, ::1]))"
"""Points (N, 3) and unit normals (N, 3)."""
BINNED_CELLS = "Tuple((int32[::1], int64[::1]))"
"""Cell numbers of the target's points, listed by direction bin, and starts (bins + 1,)."""


@njit("void(uint16[::1], uint16[::1], uint16[::1])", cache=True)
def add_counts(a, b, out):
    """Write a + b into out."""
    # separate views let the compiler use full vectors: 13 times as fast as one array with offsets
    for c in range(out.shape[0]):
        out[c] = np.uint16(a[c] + b[c])


@njit("uint16(uint16[::1], uint16[::1])", cache=True)
def largest_sum(a, b):
    """Return the largest of the sums a + b."""
    largest = np.uint16(0)
    for c in range(a.shape[0]):
        v = np.uint16(a[c] + b[c])
        largest = v if v > largest else largest
    return largest


@njit("Tuple((int64, uint16))(uint16[::1], int64, int64)", cache=True)
def take_fullest_block(histogram, row, plane):
    """Find the first of the fullest blocks of 2x2x2 cells, and empty the histogram.

    One plane after the other, so that what is summed stays in the nearest cache.

    Parameters
    ----------
    histogram
        Counts of the cells, followed by as many zeros as a plane and `row` + 2 cells.
    row, plane
        Offsets of the next cell along y and along x.

    Returns
    -------
    The lowest cell of the block, and its count.
    """
    along_z = np.empty(plane + row, np.uint16)
    before, here = np.zeros(plane, np.uint16), np.empty(plane, np.uint16)
    best, most = 0, np.uint16(0)
    for first in range(0, histogram.shape[0] - row - plane, plane):
        n = plane + row
        add_counts(histogram[first : first + n], histogram[first + 1 : first + n + 1], along_z)
        add_counts(along_z[:plane], along_z[row:], here)
        histogram[first : first + plane] = 0
        largest = largest_sum(before, here) if first else most
        if largest > most:
            cell = 0
            while np.uint16(before[cell] + here[cell]) != largest:
                cell += 1
            best, most = first - plane + cell, largest
        before, here = here, before
    return best, most


@njit("int64(float32, float32, float32)", cache=True, inline="always")
def direction_bin(x, y, z):
    """Return the bin of the line along (x, y, z): a square on one of three faces of a cube."""
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        face, m, u, v = 0, x, y, z
    elif ay >= az:
        face, m, u, v = 1, y, z, x
    else:
        face, m, u, v = 2, z, x, y
    if m == 0:
        return 0
    iu = min(BINS_PER_EDGE - 1, int((u / m + 1) * (BINS_PER_EDGE / 2)))
    iv = min(BINS_PER_EDGE - 1, int((v / m + 1) * (BINS_PER_EDGE / 2)))
    return (face * BINS_PER_EDGE + iu) * BINS_PER_EDGE + iv


@njit(
    f"void(float32[:, ::1], {ORIENTED_POINTS}, {BINNED_CELLS}, float32, int64[::1], uint16[::1])",
    cache=True,
    fastmath=True,
)
def cast_votes(R, source, target, size, half, histogram):
    """Add the votes of all pairs for the rotation R (3, 3) to the histogram.

    A vote is one subtraction of linear cell numbers. The arguments are those of
    `best_translations`.
    """
    points, normals = source
    numbers, starts = target
    wy, wz = 2 * half[1] + 1, 2 * half[2] + 1
    middle = (half[0] * wy + half[1]) * wz + half[2]
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        px = np.int64(np.floor((R[0, 0] * x + R[0, 1] * y + R[0, 2] * z) / size))
        py = np.int64(np.floor((R[1, 0] * x + R[1, 1] * y + R[1, 2] * z) / size))
        pz = np.int64(np.floor((R[2, 0] * x + R[2, 1] * y + R[2, 2] * z) / size))
        base = np.int32(middle - ((px * wy + py) * wz + pz))
        x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
        b = direction_bin(
            R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
            R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
            R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
        )
        for j in range(starts[b], starts[b + 1]):
            histogram[np.uint32(base + numbers[j])] += np.uint16(1)


@njit(
    "Tuple((float32[:, ::1], float32[::1]))"
    f"(float32[:, :, ::1], {ORIENTED_POINTS}, {BINNED_CELLS}, float32, int64[::1])",
    cache=True,
    parallel=True,
    fastmath=True,
)
def best_translations(rotations, source, target, size, half):
    """Find the translation with most votes for each rotation.

    The result is the center of the fullest 2x2x2 block of the histogram of votes.

    Parameters
    ----------
    rotations
        (K, 3, 3) rotations.
    source
        Points and normals, as `ORIENTED_POINTS`.
    target
        Cells by direction, as `BINNED_CELLS`: numbers[starts[b]:starts[b + 1]] are the linear cell
        numbers floor(y_j / size) of the points whose normals agree with direction bin b.
    size
        Edge of the cells.
    half
        (3,) cells of the histogram to each side of zero: enough that no difference wraps round.

    Returns
    -------
    Translations (K, 3) and votes (K,).
    """
    wy, wz = 2 * half[1] + 1, 2 * half[2] + 1
    cells = (2 * half[0] + 1) * wy * wz
    count = rotations.shape[0]
    translations = np.empty((count, 3), np.float32)
    votes = np.empty(count, np.float32)
    tasks = (count + ROTATIONS_PER_TASK - 1) // ROTATIONS_PER_TASK
    for task in prange(tasks):
        histogram = np.zeros(cells + wy * wz + wz + 2, np.uint16)
        for k in range(task * ROTATIONS_PER_TASK, min(count, (task + 1) * ROTATIONS_PER_TASK)):
            cast_votes(rotations[k], source, target, size, half, histogram)
            best, votes[k] = take_fullest_block(histogram, wz, wy * wz)
            # floor(y) - floor(Rx) = c stands for differences in (c - 1, c + 1): the block of c and
            # c + 1 has its center at c + 0.5
            translations[k, 0] = (best // (wy * wz) - half[0] + 0.5) * size
            translations[k, 1] = ((best // wz) % wy - half[1] + 0.5) * size
            translations[k, 2] = (best % wz - half[2] + 0.5) * size
    return translations, votes
