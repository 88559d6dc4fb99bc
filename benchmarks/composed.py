"""Real pairs that pairs.json does not list: poses composed along chains of its pairs."""

from __future__ import annotations

import json
from collections import defaultdict, deque

import numpy as np
from scipy.spatial import KDTree

from benchmarks.experiment import DATA
from mpe_core.geometry.rigid import apply, inverse
from tests.factories.clouds import Array, Pair, points_of, true_pose

MIN_OVERLAP = 0.15

Steps = dict[str, list[tuple[str, Array]]]
"""For each cloud the clouds that it is paired with, and T_other_cloud."""


def composed_pairs() -> list[Pair]:
    """Return the pairs with an overlap of at least MIN_OVERLAP, in both directions.

    Overlap is that of pairs.json: the share of source points with a target point within the
    suite's overlap_radius at the true pose. The tolerances are the largest of the suite.
    """
    suites = defaultdict(list)
    for pair in json.loads((DATA / "pairs.json").read_text()):
        suites[pair["suite"]].append(pair)
    return [pair for listed in suites.values() for pair in _of_suite(listed)]


def _of_suite(listed: list[Pair]) -> list[Pair]:
    poses = composed_poses(listed)
    clouds = {name: points_of(DATA / name) for name in sorted({n for ends in poses for n in ends})}
    trees = {name: KDTree(points) for name, points in clouds.items()}
    radius = listed[0]["overlap_radius"]
    found = []
    for (source, target), T in poses.items():
        share = overlap(apply(T, clouds[source]), trees[target], radius)
        if share >= MIN_OVERLAP:
            found.append(_pair(listed, source, target, T) | {"overlap": share})
    return found


def composed_poses(listed: list[Pair]) -> dict[tuple[str, str], Array]:
    """Compose T_target_source of each (source, target) that a chain connects and no pair lists."""
    steps: Steps = defaultdict(list)
    for pair in listed:
        T = true_pose(pair)
        steps[pair["source"]].append((pair["target"], T))
        steps[pair["target"]].append((pair["source"], inverse(T)))
    return {
        (source, target): T
        for source in list(steps)
        for target, T in _reached(source, steps).items()
        if target != source and target not in dict(steps[source])
    }


def _reached(source: str, steps: Steps) -> dict[str, Array]:
    """Return T_cloud_source of each cloud that pairs lead to, along the fewest of them."""
    poses, waiting = {source: np.eye(4)}, deque([source])
    while waiting:
        here = waiting.popleft()
        for other, T in steps[here]:
            if other not in poses:
                poses[other] = T @ poses[here]
                waiting.append(other)
    return poses


def overlap(source: Array, target: KDTree, radius: float) -> float:
    """Return the share of source points (N, 3), in the target's frame, near a target point."""
    distance, _ = target.query(source, distance_upper_bound=radius, workers=-1)
    return float(np.isfinite(distance).mean())


def _pair(listed: list[Pair], source: str, target: str, T: Array) -> Pair:
    suite, ends = listed[0]["suite"], (name.split("/")[-1] for name in (source, target))
    return {
        "id": "_".join([suite, *(name.removesuffix(".ply") for name in ends)]),
        "suite": suite,
        "source": source,
        "target": target,
        "T_target_source": T.tolist(),
        "max_rotation_deg": max(pair["max_rotation_deg"] for pair in listed),
        "max_translation": max(pair["max_translation"] for pair in listed),
    }
