"""Pairs that lead round in a ring: whether the poses agree among themselves."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import permutations, product

import numpy as np

from benchmarks.experiment import DATA, Experiment, Result, markdown
from mpe_core import register
from mpe_core.geometry.rigid import inverse
from tests.factories.checks import rotation_error
from tests.factories.clouds import Array, points_of, true_pose

RINGS = {
    "bunny": [f"bunny/bun{angle:03d}.ply" for angle in (0, 45, 90, 180, 270, 315)],
    "dragon": [f"dragon/dragonStandRight_{angle}.ply" for angle in range(0, 360, 24)],
}
"""Views once around an object."""

Poses = dict[tuple[str, str], Array]
"""T_b_a between clouds a and b, both ways round."""


def run() -> Result:
    """Measure, and return the figures that the page shows."""
    poses, published = _poses()
    rings = [(f"{name}, once around", ring) for name, ring in RINGS.items()]
    rings += [(f"{ring[0].split('/')[0]}, three views", ring) for ring in triangles(poses)]
    return {"rows": [_row(name, ring, poses, published) for name, ring in rings]}


def _poses() -> tuple[Poses, Poses]:
    """Return the poses that `register` finds with its defaults, and those of pairs.json."""
    found: Poses = {}
    published: Poses = {}
    for pair in json.loads((DATA / "pairs.json").read_text()):
        if pair["suite"] in RINGS:
            source, target = (points_of(DATA / pair[end]) for end in ("source", "target"))
            ends = pair["source"], pair["target"]
            for poses, T in (
                (found, register(source, target).T_target_source),
                (published, true_pose(pair)),
            ):
                poses[ends], poses[ends[::-1]] = T, inverse(T)
    return found, published


def triangles(poses: Poses) -> list[Sequence[str]]:
    """List every three clouds of which each two are a pair, once."""
    clouds = sorted({cloud for ends in poses for cloud in ends})
    rings = [(b, a, c) for (a, b), c in product(poses, clouds) if a < b < c]
    return [ring for ring in rings if all(ends in poses for ends in permutations(ring, 2))]


def closure(poses: Poses, ring: Sequence[str]) -> float:
    """Return the angle in degrees of the product of the poses once around a ring of clouds."""
    T = np.eye(4)
    for a, b in _steps(ring):
        T = poses[a, b] @ T
    return rotation_error(T, np.eye(4))


def _steps(ring: Sequence[str]) -> list[tuple[str, str]]:
    return list(zip(ring, (*ring[1:], ring[0]), strict=True))


def _row(name: str, ring: Sequence[str], poses: Poses, published: Poses) -> Result:
    return {
        "ring": name,
        "views": len(ring),
        "clouds": list(ring),
        "closure": closure(poses, ring),
        "published_closure": closure(published, ring),
        "apart": [rotation_error(poses[step], published[step]) for step in _steps(ring)],
    }


def table(result: Result) -> str:
    """Return the page's text and tables in Markdown."""
    columns = (
        "ring",
        "views",
        "MPL: degrees left after it",
        "over the root of the views",
        "ground truth: degrees left",
        "MPL from ground truth, median of the pairs",
    )
    rows = [
        (
            row["ring"],
            row["views"],
            row["closure"],
            row["closure"] / np.sqrt(row["views"]),
            row["published_closure"],
            float(np.median(row["apart"])),
        )
        for row in result["rows"]
    ]
    return (
        "Poses of pairs that lead round in a ring must end where they began. Each pair of views is "
        "registered on its own, so its errors know nothing of those of the others: what is left "
        "after a ring, over the root of the number of its views, tells how large they are. Where "
        "poses differ by more than that from the ground truth, which is published as good to 0.1 "
        "to 0.4 degrees, the difference is not the registration's: it lies in that ground truth, "
        "or in how the scanner bends each view.\n\n" + markdown(columns, rows)
    )


CLOSURE = Experiment("closure", "Poses once around", run, table)
