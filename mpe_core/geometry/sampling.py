"""Samples of the points of a cloud."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mpe_core.kernels.farthest_point import farthest_order

Scalar = TypeVar("Scalar", bound=np.generic)

OVERSAMPLING = 3
"""Rows that a spread sample draws at random for each row that it returns."""


def take_every(rows: NDArray[Scalar], count: int) -> NDArray[Scalar]:
    """Copy every k-th of the rows (N, ...): `count` of them, or up to twice as many."""
    return rows[:: max(1, len(rows) // count)].copy()


def sample_points(
    points: NDArray[np.float64],
    count: int,
    rng: np.random.Generator,
    weights: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Draw points of a cloud (N, 3) and return them in the cloud's order.

    Returns
    -------
    (min(count, N), 3)
        Without weights: drawn evenly, without replacement.
    (count, 3)
        With weights (N,): each point as often as its share of the weight asks for.
    """
    if weights is not None:
        mixed = rng.permutation(len(points))
        return points[np.sort(mixed[resample_rows(weights[mixed], count)])]
    if count >= len(points):
        return points
    return points[np.sort(rng.choice(len(points), count, replace=False))]


def sample_weighted_rows(
    weights: NDArray[np.generic], count: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Draw up to `count` rows without replacement, with a chance that grows with their weight.

    Every prefix of the result is such a sample, too (Efraimidis and Spirakis 2006). Rows of weight
    0 are never drawn.
    """
    w = np.asarray(weights, np.float64)
    usable = np.flatnonzero(w > 0)
    keys = -np.log(rng.random(len(usable))) / w[usable]
    if count < len(usable):
        first = np.argpartition(keys, count)[:count]
        usable, keys = usable[first], keys[first]
    return usable[np.argsort(keys, kind="stable")]


def resample_rows(weights: NDArray[np.generic], count: int) -> NDArray[np.int64]:
    """Return (count,) rows, each as often as its share of the weights (N,) asks for.

    Systematic resampling (Kitagawa 1996) at fixed places: no random numbers.
    """
    share = np.cumsum(np.asarray(weights, np.float64))
    return np.searchsorted(share / share[-1], (np.arange(count) + 0.5) / count)


def sample_spread_rows(
    points: NDArray[np.float32],
    weights: NDArray[np.float32],
    count: int,
    rng: np.random.Generator,
) -> NDArray[np.int64]:
    """Draw up to `count` rows of points (N, 3) by weight, spread over the cloud.

    They are the first of the farthest-point order of OVERSAMPLING times as many weighted rows.
    """
    drawn = sample_weighted_rows(weights, OVERSAMPLING * count, rng)
    order: NDArray[np.int64] = drawn[farthest_order(points[drawn], min(count, len(drawn)))]
    return order
