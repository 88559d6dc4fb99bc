"""Choosing some points of a cloud."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.kernels.farthest_point import farthest_order


def random_rows(
    points: NDArray[np.float64],
    count: int,
    rng: np.random.Generator,
    weights: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """(min(count, N), 3) rows drawn evenly without replacement, in their first order; with weights
    (N,) count rows, each as often as its share of them asks for."""
    if weights is not None:
        mixed = rng.permutation(len(points))
        return points[np.sort(mixed[proportional_rows(weights[mixed], count)])]
    if count >= len(points):
        return points
    return points[np.sort(rng.choice(len(points), count, replace=False))]


def weighted_rows(
    weights: NDArray[np.generic], count: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Up to count row numbers with positive weight, drawn without replacement, likelier with more
    weight, in an order whose every prefix is such a sample (Efraimidis and Spirakis 2006)."""
    w = np.asarray(weights, np.float64)
    usable = np.flatnonzero(w > 0)
    keys = -np.log(rng.random(len(usable))) / w[usable]
    if count < len(usable):
        first = np.argpartition(keys, count)[:count]
        usable, keys = usable[first], keys[first]
    return usable[np.argsort(keys, kind="stable")]


def proportional_rows(weights: NDArray[np.generic], count: int) -> NDArray[np.int64]:
    """(count,) row numbers, each as often as its share of the weights (N,) asks for: systematic
    resampling (Kitagawa 1996), without chance."""
    share = np.cumsum(np.asarray(weights, np.float64))
    return np.searchsorted(share / share[-1], (np.arange(count) + 0.5) / count)


def even_rows(
    points: NDArray[np.float32],
    weights: NDArray[np.float32],
    count: int,
    rng: np.random.Generator,
) -> NDArray[np.int64]:
    """Up to count row numbers of points (N, 3), weighted and yet spread out: the farthest-point
    order of a weighted draw three times as large."""
    drawn = weighted_rows(weights, 3 * count, rng)
    order: NDArray[np.int64] = drawn[farthest_order(points[drawn], min(count, len(drawn)))]
    return order
