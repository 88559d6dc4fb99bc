"""Pairs that no pose registers: source and target show different objects."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import permutations

import numpy as np

from benchmarks.experiment import DATA
from mpe_core.geometry.rigid import apply
from tests.factories.clouds import Array, motion, points_of, random_rotation

SHARED = {  # things that more than one suite shows, or may show; every other suite shows its own
    "bunny": {"bunny"},
    "bunny_rgbd": {"bunny"},
    "goicp": {"bunny"},
    "dragon": {"dragon"},
    "fgr": {"bunny", "dragon", "models of FGR"},
    "fricp": {"bunny", "dragon", "models of FGR"},
    "uwa_chef": {"chef"},
    "uwa_scene": {"chef"},
    "livingroom": {"a living room"},
    "rgbd_room": {"a living room"},
    "kitti10m": {"streets of Karlsruhe"},
    "lidar_small_gicp": {"streets of Karlsruhe"},
}


def impossible_pairs(count: int) -> Iterator[tuple[str, Array, Array]]:
    """Yield name, source (N, 3) and target (M, 3) of pairs of suites that share no object.

    The source is scaled to the diagonal of the target and turned at random. The pairs are always
    the same, drawn evenly from all combinations of suites.
    """
    pairs = json.loads((DATA / "pairs.json").read_text())
    suites = list(dict.fromkeys(pair["suite"] for pair in pairs))
    foreign = [(a, b) for a, b in permutations(suites, 2) if _things(a).isdisjoint(_things(b))]
    rng = np.random.default_rng(0)
    for row in rng.permutation(len(foreign))[:count]:
        source, target = (
            rng.choice([pair["id"] for pair in pairs if pair["suite"] == suite])
            for suite in foreign[row]
        )
        ends = {pair["id"]: pair for pair in pairs}
        x, y = points_of(DATA / ends[source]["source"]), points_of(DATA / ends[target]["target"])
        x = x * np.linalg.norm(np.ptp(y, axis=0)) / np.linalg.norm(np.ptp(x, axis=0))
        yield f"{source} on {target}", apply(motion(x, random_rotation(rng), rng), x), y


def _things(suite: str) -> set[str]:
    return SHARED.get(suite, {suite})
