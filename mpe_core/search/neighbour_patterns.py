"""Poses of volumes of many points that correspond one by one, by the distances of neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mpe_core.geometry.rigid import apply, fit
from mpe_core.search.congruence import Coincidence

Array = NDArray[np.float64]

NEIGHBOURS = 6
"""Neighbours of a point whose distances, the least first, are its pattern."""

TRIED_POINTS, COUNTED_POINTS = 400, 100
"""Source points whose patterns are looked for, and those that are counted at a pose."""

TOLERANCE = 0.1
"""Distance of corresponding points, in spacings."""

POLISH_ROUNDS = 6
"""Fits to all matches that follow the best pattern."""


def match_patterns(source: Array, target: Array, seed: int) -> tuple[Coincidence, float]:
    """Find the pose that lays the most points of the source on points of the target.

    Parameters
    ----------
    source, target
        (N, 3) and (M, 3) points, seven at least.
    seed
        Seed of the random choices.

    Returns
    -------
    The pose with its distances, and the distance between neighbouring points of the target.
    """
    rng = np.random.default_rng(seed)
    tree = cKDTree(target)
    here, rows_here = _nearest(cKDTree(source), source, NEIGHBOURS + 1)
    there, rows_there = _nearest(tree, target, NEIGHBOURS + 1)
    spacing = float(np.median(there[:, 1]))
    tried = rng.permutation(len(source))[:TRIED_POINTS]
    _, alike = _nearest(cKDTree(there[:, 1:]), here[tried, 1:])
    counted = source[rng.permutation(len(source))[:COUNTED_POINTS]]
    best, most = np.eye(4), -1
    for row, other in zip(tried, alike, strict=True):
        T = fit(source[rows_here[row]], target[rows_there[other]])
        distances, _ = _nearest(tree, apply(T, counted))
        count = int((distances < 3 * TOLERANCE * spacing).sum())
        if count > most:
            best, most = T, count
    return _polish(best, source, target, tree, TOLERANCE * spacing), spacing


def _polish(T: Array, source: Array, target: Array, tree: cKDTree, tolerance: float) -> Coincidence:
    for _ in range(POLISH_ROUNDS):
        distances, rows = _nearest(tree, apply(T, source))
        near = distances < 3 * tolerance
        if near.sum() <= NEIGHBOURS:
            break
        T = fit(source[near], target[rows[near]])
    distances, _ = _nearest(tree, apply(T, source))
    return Coincidence(T, distances, int((distances < tolerance).sum()))


def _nearest(tree: cKDTree, queries: Array, count: int = 1) -> tuple[Array, NDArray[np.int64]]:
    distances, rows = tree.query(queries, count)
    return np.asarray(distances), np.asarray(rows, np.int64)
