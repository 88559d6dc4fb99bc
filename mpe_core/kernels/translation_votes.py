"""Translation votes: for a rotation R every pair (i, j) proposes t = y_j - R x_i."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

ROTATIONS_PER_TASK = 8
FACE = 4
"""Bins along an edge of the direction cube: 48 lines about 25 degrees apart."""


@njit("void(uint16[::1], uint16[::1], uint16[::1])", cache=True)
def add(a, b, out):
    # separate views let the compiler use full vectors: 13 times quicker than one array with offsets
    for c in range(out.shape[0]):
        out[c] = np.uint16(a[c] + b[c])


@njit("uint16(uint16[::1], uint16[::1], int64, int64, int64)", cache=True)
def sum_blocks(histogram, scratch, cells, row, plane):
    """Sums of 2x2x2 blocks into scratch[:cells]; returns the largest."""
    n = cells + plane + row
    add(histogram[:n], histogram[1 : n + 1], scratch[:n])
    n = cells + plane
    add(scratch[:n], scratch[row : row + n], histogram[:n])
    add(histogram[:cells], histogram[plane : plane + cells], scratch[:cells])
    most = np.uint16(0)
    for c in range(cells):
        v = scratch[c]
        most = v if v > most else most
    return most


@njit("int64(float32, float32, float32)", cache=True, inline="always")
def direction_bin(x, y, z):
    """Cell of the line along (x, y, z) on three faces of a cube, each FACE x FACE."""
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        face, m, u, v = 0, x, y, z
    elif ay >= az:
        face, m, u, v = 1, y, z, x
    else:
        face, m, u, v = 2, z, x, y
    if m == 0:
        return 0
    iu = min(FACE - 1, int((u / m + 1) * (FACE / 2)))
    iv = min(FACE - 1, int((v / m + 1) * (FACE / 2)))
    return (face * FACE + iu) * FACE + iv


@njit(
    "Tuple((float32[:, ::1], float32[::1]))(float32[:, :, ::1], float32[:, ::1], float32[:, ::1],"
    " int32[::1], int64[::1], float32, int64[::1])",
    cache=True,
    parallel=True,
    fastmath=True,
)
def best_translations(rotations, source, normals, lists, starts, size, half):
    """The fullest 2x2x2 block of the histogram of votes: (translations, votes) for each rotation.

    `lists[starts[b]:starts[b + 1]]` holds the linear cell numbers floor(y_j / size) of the target
    points whose normals agree with direction bin b. A vote is one subtraction of cell numbers; the
    histogram is `half` cells wide to each side, so that no difference wraps round.
    """
    wy, wz = 2 * half[1] + 1, 2 * half[2] + 1
    cells = (2 * half[0] + 1) * wy * wz
    centre = (half[0] * wy + half[1]) * wz + half[2]
    count = rotations.shape[0]
    translations = np.empty((count, 3), np.float32)
    votes = np.empty(count, np.float32)
    tasks = (count + ROTATIONS_PER_TASK - 1) // ROTATIONS_PER_TASK
    for task in prange(tasks):
        histogram = np.empty(cells + wy * wz + wz + 2, np.uint16)
        sums = np.empty(cells + wy * wz + wz + 2, np.uint16)
        for k in range(task * ROTATIONS_PER_TASK, min(count, (task + 1) * ROTATIONS_PER_TASK)):
            histogram[:] = 0
            R = rotations[k]
            for i in range(source.shape[0]):
                x, y, z = source[i, 0], source[i, 1], source[i, 2]
                px = np.int64(np.floor((R[0, 0] * x + R[0, 1] * y + R[0, 2] * z) / size))
                py = np.int64(np.floor((R[1, 0] * x + R[1, 1] * y + R[1, 2] * z) / size))
                pz = np.int64(np.floor((R[2, 0] * x + R[2, 1] * y + R[2, 2] * z) / size))
                base = np.int32(centre - ((px * wy + py) * wz + pz))
                x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
                b = direction_bin(
                    R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
                    R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
                    R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
                )
                for j in range(starts[b], starts[b + 1]):
                    histogram[np.uint32(base + lists[j])] += np.uint16(1)
            most = sum_blocks(histogram, sums, cells, wz, wy * wz)
            best = 0
            while sums[best] != most:
                best += 1
            # floor(y) - floor(Rx) = c stands for differences in (c - 1, c + 1): block c, c + 1 is
            # centred at c + 0.5
            translations[k, 0] = (best // (wy * wz) - half[0] + 0.5) * size
            translations[k, 1] = ((best // wz) % wy - half[1] + 0.5) * size
            translations[k, 2] = (best % wz - half[2] + 0.5) * size
            votes[k] = most
    return translations, votes
