"""Trimmed ICP: fast descent from a coarse pose to the nearest minimum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mpe_core.geometry.nearest import NearestNeighbors
from mpe_core.geometry.rigid import apply, fit, pose
from mpe_core.refine.minimum import Minimum

Array = NDArray[np.float64]

MIN_OVERLAP = 0.4
"""Least overlap that is tried where none is given; Chetverikov's choice."""
TRIMMING_EXPONENT = 2.0
"""lambda of the objective; Chetverikov's choice."""
MIN_COARSE_POINTS = 2000
"""Least number of source points of the first, coarsest pass."""
REACH_FACTOR = 3.0
"""Reach of the next search for nearest points, over the largest distance of a kept pair."""
CONVERGENCE_TOL = 1e-4
"""Largest motion of the points in the last step, in the unit of the clouds (docs/tuning.md)."""
MIN_EXTRAPOLATION_COSINE = 0.9
"""Cosine of the angle between two steps from which on they are extrapolated."""
MAX_EXTRAPOLATION = 10.0
"""Largest number of steps that an extrapolation takes at once."""


def trimmed_icp(
    source: Array,
    target: NearestNeighbors,
    T: Array,
    overlap: float | None,
    max_iterations: int,
    report: Callable[[float], None],
    source_weights: Array | None = None,
    target_weights: Array | None = None,
) -> Minimum:
    """Register a source to a target by trimmed ICP (Chetverikov et al. 2005), from the pose T.

    Minimizes e(xi) / xi^(1 + lambda) over the pose and the overlap xi, where e is the mean square
    distance of the xi N source points that are closest to the target. Passes over every 4^k-th
    source point come first; the last pass has all points.

    Parameters
    ----------
    source
        (N, 3) centered points.
    target
        Tree of the target's points (M, 3).
    T
        (4, 4) T_target_source to start from.
    overlap
        Fixed xi, or None to search it.
    max_iterations
        Bound on the iterations of each pass.
    report
        Receives the fraction of a pass's iterations done, 0 to 1.
    source_weights, target_weights
        (N,) and (M,) weights, 1 where none are given. With weights xi is a share of the source's
        weight, e is the weighted mean, and a pair enters the fit with the product of both weights.

    Returns
    -------
    Pose at rest, with the iterations of the last pass.
    """
    problem = _Problem(
        source,
        np.ones(len(source)) if source_weights is None else source_weights,
        target,
        np.ones(len(target.points)) if target_weights is None else target_weights,
        overlap,
    )
    stride = 1
    while len(source) // (4 * stride) >= MIN_COARSE_POINTS:
        stride *= 4
    reach = np.inf
    while True:
        found, reach = problem.thinned(stride).descend(T, reach, max_iterations, report)
        if stride == 1:
            return found
        T, stride = found.T, stride // 4


def trimmed_count(
    distances: Array, total: float, overlap: float | None, weights: Array | None = None
) -> int:
    """Return how many of the closest source points trimmed ICP keeps.

    Parameters
    ----------
    distances
        (M,) ascending distances of the closest source points.
    total
        Total weight of all source points.
    overlap
        Share of the total weight to keep, or None for the share that minimizes the objective.
    weights
        (M,) weights of the closest points; 1 where none are given.
    """
    w = np.ones(len(distances)) if weights is None else weights
    cumulative = np.cumsum(w)
    if overlap is not None:
        nearest = int(np.argmin(np.abs(cumulative - overlap * total))) + 1
        return min(len(distances), max(3, nearest))
    least = int(np.searchsorted(cumulative, MIN_OVERLAP * total, side="right"))
    first = min(len(distances), max(3, least))
    kept = cumulative[first - 1 :]
    mean_square = np.cumsum(w * distances**2)[first - 1 :] / kept
    return first + int(np.argmin(mean_square / (kept / total) ** (1 + TRIMMING_EXPONENT)))


@dataclass(frozen=True, slots=True)
class _Pairs:
    source: NDArray[np.int64]
    """(K,) rows of the kept source points."""
    target: NDArray[np.int64]
    """(K,) rows of their nearest target points."""
    max_distance: float


@dataclass(frozen=True, slots=True)
class _Problem:
    """Arguments of `trimmed_icp` that stay the same from step to step."""

    source: Array
    source_weights: Array
    target: NearestNeighbors
    target_weights: Array
    overlap: float | None

    def thinned(self, stride: int) -> _Problem:
        """Return the problem with every stride-th source point."""
        return replace(
            self, source=self.source[::stride], source_weights=self.source_weights[::stride]
        )

    def descend(
        self, T: Array, reach: float, max_iterations: int, report: Callable[[float], None]
    ) -> tuple[Minimum, float]:
        """Iterate to rest; also return the distance up to which target points matter."""
        mean_square = np.average(self.source**2, axis=0, weights=self.source_weights).sum()
        arm = float(np.sqrt(mean_square))
        last_step = np.zeros(6)
        for iteration in range(1, max_iterations + 1):
            report(iteration / max_iterations)
            pairs = self._closest(T, reach)
            last, T = T, self._fit(pairs)
            reach = REACH_FACTOR * pairs.max_distance
            step = _step(last, T, arm)
            if np.linalg.norm(step) < CONVERGENCE_TOL:
                return Minimum(T, True, iteration), reach
            ahead = _extrapolation(last_step, step)
            T = _advanced(T, ahead * step, arm)
            last_step = np.zeros(6) if ahead else step
        return Minimum(T, False, max_iterations), reach

    def _fit(self, pairs: _Pairs) -> Array:
        weights = self.source_weights[pairs.source] * self.target_weights[pairs.target]
        return fit(self.source[pairs.source], self.target.points[pairs.target], weights)

    def _closest(self, T: Array, reach: float) -> _Pairs:
        """Return the pairs of the source points that are closest to the target, trimmed."""
        weights, total = self.source_weights, float(self.source_weights.sum())
        distance, nearest = self.target.nearest(apply(T, self.source), reach)
        order = np.argsort(distance, kind="stable")
        rows = order[: int(np.searchsorted(distance[order], np.inf))]
        needed = (self.overlap or MIN_OVERLAP) * total
        if len(rows) < len(self.source) and weights[rows].sum() < needed:
            return self._closest(T, np.inf)
        kept = rows[: trimmed_count(distance[rows], total, self.overlap, weights[rows])]
        return _Pairs(kept, nearest[kept], float(distance[kept[-1]]))


def _step(last: Array, T: Array, arm: float) -> Array:
    """Return the (6,) motion between two poses: rotation vector times arm, and translation."""
    rotation = Rotation.from_matrix(T[:3, :3] @ last[:3, :3].T).as_rotvec()
    return np.concatenate([rotation * arm, T[:3, 3] - last[:3, 3]])


def _advanced(T: Array, step: Array, arm: float) -> Array:
    """Return the pose T after a step as `_step` returns it."""
    R = Rotation.from_rotvec(step[:3] / arm).as_matrix()
    return pose(R @ T[:3, :3], T[:3, 3] + step[3:])


def _extrapolation(last: Array, step: Array) -> float:
    """Return the number of further steps to take at once (Besl and McKay 1992).

    Steps that point the same way and shrink by r each have r / (1 - r) times the last one left.
    """
    length, last_length = np.linalg.norm(step), np.linalg.norm(last)
    if step @ last <= MIN_EXTRAPOLATION_COSINE * length * last_length:
        return 0.0
    ratio = min(float(length / last_length), MAX_EXTRAPOLATION / (1 + MAX_EXTRAPOLATION))
    return ratio / (1 - ratio)
