"""Peak arithmetic and memory bandwidth of the machine, measured on all threads."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

Timer = Callable[..., float]
"""Seconds of a call with its arguments."""

SIDE = 3000  # of the matrices
IN_CACHE, BLOCKS, DEGREE = 2048, 20_000, 32  # numbers, passes over them, of the polynomials
IN_MEMORY = 30_000_000  # numbers of each array: many times the caches


@njit(parallel=True, fastmath=True)
def _polynomials(x: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    for block in prange(BLOCKS):
        total = np.float32(0)
        for j in range(IN_CACHE):
            value = np.float32(block)
            for _ in range(DEGREE):
                value = value * x[j] + np.float32(0.5)
            total += value
        out[block] = total


@njit(parallel=True)
def _triad(a: NDArray[np.float32], b: NDArray[np.float32], c: NDArray[np.float32]) -> None:
    for i in prange(len(a)):
        a[i] = b[i] + np.float32(3) * c[i]


def peak_flops(seconds: Timer) -> float:
    """Measure the float32 operations a second: the faster of two loads."""
    square = np.random.default_rng(0).random((SIDE, SIDE), np.float32)
    product = 2 * SIDE**3 / seconds(np.matmul, square, square)
    x, out = square[0, :IN_CACHE] / 2, np.empty(BLOCKS, np.float32)
    _polynomials(x, out)  # compiles
    return max(product, 2 * DEGREE * IN_CACHE * BLOCKS / seconds(_polynomials, x, out))


def bandwidth(seconds: Timer) -> float:
    """Measure the bytes a second between memory and processor: two arrays read, one written."""
    a, b, c = (np.ones(IN_MEMORY, np.float32) for _ in range(3))
    _triad(a, b, c)
    return 3 * a.nbytes / seconds(_triad, a, b, c)
