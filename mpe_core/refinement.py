"""Trimmed ICP: the fast descent from a coarse pose to the nearest minimum."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mpe_core.descent import Descent
from mpe_core.neighbours import Neighbours
from mpe_core.rigid import apply, fit

Array = NDArray[np.float64]

LEAST_OVERLAP = 0.4  # Chetverikov's lower bound of the searched overlap
TRIMMING = 2.0  # lambda of the objective; Chetverikov's choice
COARSE = 2000  # source points of the first iterations
STILL = 1e-6  # a step that moves no point further (in radii of the cloud) ends the iteration


def trimmed_icp(
    source: Array,
    target: Neighbours,
    T: Array,
    overlap: float | None,
    max_iterations: int,
    report: Callable[[float], None],
) -> Descent:
    """Trimmed ICP (Chetverikov et al. 2005) of the source (N, 3) onto the target, from the pose T.

    Minimises e(xi) / xi^(1 + lambda) over the pose and the overlap xi, where e is the mean square
    distance of the xi N source points that are closest to the target. A given overlap stays fixed.
    A coarse pass over some of the source comes first; the last pass sees all of it.
    """
    for points in ([source[:: len(source) // COARSE]] if len(source) >= 2 * COARSE else []) + [
        source
    ]:
        result = _pass(points, target, T, overlap, max_iterations, report)
        T = result.T_target_source
    return result


def _pass(
    source: Array,
    target: Neighbours,
    T: Array,
    overlap: float | None,
    max_iterations: int,
    report: Callable[[float], None],
) -> Descent:
    reach = np.abs(source).max()
    for iteration in range(1, max_iterations + 1):
        report(iteration / max_iterations)
        distance, nearest = target.nearest(apply(T, source))
        order = np.argsort(distance, kind="stable")
        kept = trimmed_count(distance[order], overlap)
        rows = order[:kept]
        last, T = T, fit(source[rows], target.points[nearest[rows]])
        if _largest_step(last, T, reach) < STILL:
            return Descent(T, True, iteration)
    return Descent(T, False, max_iterations)


def trimmed_count(ordered: Array, overlap: float | None) -> int:
    """How many of the ascending distances (N,) trimmed ICP keeps: overlap N, or, without a given
    overlap, the count that minimises its objective."""
    count = len(ordered)
    if overlap is not None:
        return min(count, max(3, round(overlap * count)))
    first = min(count, max(3, int(LEAST_OVERLAP * count)))
    kept = np.arange(first, count + 1)
    mean_square = np.cumsum(ordered**2)[first - 1 :] / kept
    return int(kept[np.argmin(mean_square / (kept / count) ** (1 + TRIMMING))])


def _largest_step(last: Array, T: Array, reach: float) -> float:
    change = T - last
    return float(np.abs(change[:3, :3]).max() * reach + np.abs(change[:3, 3]).max())
