"""Congruence search: few points that correspond one by one, as markers, targets and trees do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mpe_core.geometry.rigid import fit

Array = NDArray[np.float64]

MIN_POINTS, MAX_POINTS = 4, 1000
"""Points of each cloud: three fit any three of the same distances, more take seconds."""

TOLERANCES = (1e-4, 0.02, 0.1)
"""Errors of the points that are tried, in spacings; at more, chance decides."""

TRIPLES = 30
"""Triples of source points that are looked for: four are enough where half of the points
correspond."""

MAX_PAIRS = 4000
"""Pairs of target points that are compared with one pair of the source, at most."""

MAX_HYPOTHESES, COUNTED_POINTS, MAX_POLISHED = 256, 30, 4
"""Poses of one triple that are counted, points that are counted, and poses that are polished."""

POLISH_ROUNDS = 4
"""Fits to all matches that follow a triple."""


@dataclass(frozen=True, slots=True)
class Coincidence:
    """Pose with the points that it lays on each other."""

    T: Array
    """(4, 4) T_target_source."""
    distances: Array
    """(N,) distance of each source point from its nearest target point."""
    count: int
    """Points within the tolerance."""


class CongruenceSearch:
    """Search for the pose that lays the most points of the source on points of the target."""

    def __init__(self, source: Array, target: Array, seed: int = 0) -> None:
        """Measure the distances within source (N, 3) and target (M, 3)."""
        self._source, self._target = source, target
        self._tree = cKDTree(target)
        self._rng = np.random.default_rng(seed)
        self._within = _distances(target, target)
        first, second = np.triu_indices(len(target), 1)
        lengths = self._within[first, second]
        order = np.argsort(lengths, kind="stable")
        self._lengths = lengths[order]
        self._pairs = np.column_stack([first, second])[order]

    @cached_property
    def spacing(self) -> float:
        """Distance of a target point from its nearest neighbour, at the median."""
        others = self._within + np.where(np.eye(len(self._target), dtype=bool), np.inf, 0)
        return float(np.median(others.min(axis=1)))

    def find(self, tolerance: float) -> list[Coincidence]:
        """Find poses that lay at least four points within the tolerance, most points first."""
        found: list[Coincidence] = []
        enough = 0.9 * min(len(self._source), len(self._target))
        for triple in self._triples():
            for T in self._hypotheses(triple, tolerance):
                coincidence = self._polish(T, tolerance)
                if coincidence.count >= MIN_POINTS:
                    found.append(coincidence)
            if found and max(each.count for each in found) >= enough:
                break
        return sorted(found, key=lambda each: (-each.count, float(each.distances.sum())))

    def _triples(self) -> Iterator[NDArray[np.int64]]:
        """Triples of source points that span a plane."""
        for _ in range(TRIPLES):
            rows = self._rng.choice(len(self._source), min(len(self._source), 12), replace=False)
            i = rows[0]
            j = rows[np.argmax(np.square(self._source[rows] - self._source[i]).sum(axis=1))]
            axis = self._source[j] - self._source[i]
            height = np.linalg.norm(np.cross(self._source[rows] - self._source[i], axis), axis=1)
            k = rows[np.argmax(height)]
            if height.max() > 0.05 * (axis @ axis):
                yield np.array([i, j, k])

    def _hypotheses(self, triple: NDArray[np.int64], tolerance: float) -> Array:
        """(K, 4, 4) poses that lay the triple on three target points of the same distances."""
        corners = self._source[triple]
        ij, ik, jk = (float(np.linalg.norm(corners[a] - corners[b])) for a, b in EDGES)
        low, high = np.searchsorted(self._lengths, (ij - 2 * tolerance, ij + 2 * tolerance))
        pairs = self._pairs[low:high]
        if len(pairs) > MAX_PAIRS:
            pairs = pairs[self._rng.choice(len(pairs), MAX_PAIRS, replace=False)]
        a, b = np.concatenate([pairs, pairs[:, ::-1]]).T
        fits = (np.abs(self._within[a] - ik) < 2 * tolerance) & (
            np.abs(self._within[b] - jk) < 2 * tolerance
        )
        rows, c = np.nonzero(fits)
        chosen = self._rng.permutation(len(rows))[:MAX_HYPOTHESES]
        corner_rows = np.column_stack([a[rows[chosen]], b[rows[chosen]], c[chosen]])
        poses = [fit(corners, self._target[each]) for each in corner_rows]
        return self._best(np.array(poses).reshape(-1, 4, 4), tolerance)

    def _best(self, poses: Array, tolerance: float) -> Array:
        """Poses that lay the most of some source points on the target."""
        if len(poses) <= MAX_POLISHED:
            return poses
        subset = self._source[self._rng.permutation(len(self._source))[:COUNTED_POINTS]]
        moved = np.einsum("kij,nj->kni", poses[:, :3, :3], subset) + poses[:, None, :3, 3]
        distances, _ = self._tree.query(moved.reshape(-1, 3), distance_upper_bound=2 * tolerance)
        counts = np.isfinite(distances).reshape(len(poses), -1).sum(axis=1)
        best: Array = poses[np.argsort(-counts, kind="stable")[:MAX_POLISHED]]
        return best

    def _polish(self, T: Array, tolerance: float) -> Coincidence:
        reach = 3 * tolerance
        for _ in range(POLISH_ROUNDS):
            distances, rows = self._nearest(T)
            near = distances < reach
            if near.sum() < MIN_POINTS:
                break
            T = fit(self._source[near], self._target[rows[near]])
        distances, rows = self._nearest(T)
        return Coincidence(T, distances, len(np.unique(rows[distances < reach])))

    def _nearest(self, T: Array) -> tuple[Array, NDArray[np.int64]]:
        moved = np.einsum("ij,nj->ni", T[:3, :3], self._source) + T[:3, 3]
        distances, rows = self._tree.query(moved)
        return np.asarray(distances), np.asarray(rows, np.int64)


EDGES = ((0, 1), (0, 2), (1, 2))


def _distances(x: Array, y: Array) -> Array:
    """(N, M) distances between points x (N, 3) and y (M, 3); exact for equal ones."""
    square = np.zeros((len(x), len(y)))
    for axis in range(3):
        square += np.square(x[:, None, axis] - y[None, :, axis])
    return np.sqrt(square)
