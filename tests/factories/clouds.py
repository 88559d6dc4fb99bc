"""Clouds with a known truth, for the tests."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mpe_core.geometry.rigid import apply, axis_rotation, inverse, pose
from service.formats import read_points

Array = NDArray[np.float64]
Pair = dict[str, Any]
"""An entry of pairs.json, or one in its shape."""


@dataclass(frozen=True)
class Trial:
    """A pair to register and the pose that is right."""

    source: Array
    target: Array
    T_target_source: Array


def bunny(data: Path, name: str = "bun_zipper_res3") -> Array:
    """The Stanford bunny, centred, its farthest point at distance 1."""
    points = points_of(data / "bunny_whole" / f"{name}.ply")
    points = points - points.mean(axis=0)
    return points / np.linalg.norm(points, axis=1).max()


def points_of(path: Path) -> Array:
    return read_points(path).points.astype(np.float64)


def knot(count: int, rng: np.random.Generator) -> Array:
    """A bent tube of growing width: random points of a smooth surface without any symmetry."""
    s, angle = rng.uniform(0, 1, count), rng.uniform(0, 2 * np.pi, count)
    spine = np.column_stack([s, 0.5 * s**2, 0.3 * np.sin(4 * s)])
    width = (0.05 + 0.15 * s)[:, None]
    return spine + width * np.column_stack([np.zeros(count), np.cos(angle), 0.6 * np.sin(angle)])


def room(rng: np.random.Generator, count: int = 12_000) -> Array:
    """Walls, floor and ceiling of a box: three half turns lay it on itself."""
    size = np.array([1.0, 0.7, 0.45])
    points = rng.uniform(-1, 1, (count, 3)) * size
    face = rng.integers(0, 3, count)
    rows = np.arange(count)
    points[rows, face] = np.sign(points[rows, face]) * size[face]
    return points


def turned_over(cloud: Array) -> Array:
    """A room with two opposite edges cut off: only a half turn about x lays it on itself."""
    return cloud[cloud[:, 1] * cloud[:, 2] < 0.1]


def sheet(rng: np.random.Generator, count: int = 8000) -> Array:
    """A wavy sheet seen from +z: a half turn about y lays its back on its front."""
    x, y = rng.uniform(-0.6, 0.6, count), rng.uniform(-1, 1, count)
    return np.column_stack([x, y, 0.1 * np.sin(5 * x) * (1 + 0.5 * y)])


def moved(
    cloud: Array,
    rng: np.random.Generator,
    *,
    largest_deg: float = 90.0,
    noise: float = 0.0,
    outliers: int = 0,
) -> Trial:
    """The cloud as target; as source itself with Gaussian noise and uniform outliers in its box,
    turned about its centroid by up to largest_deg and moved by up to half its diagonal."""
    source = cloud + noise * rng.normal(size=cloud.shape)
    stray = rng.uniform(cloud.min(axis=0), cloud.max(axis=0), size=(outliers, 3))
    T = motion(
        cloud, axis_rotation(rng.normal(size=3), np.radians(rng.uniform(0, largest_deg))), rng
    )
    return Trial(apply(T, np.vstack([source, stray])), cloud, inverse(T))


def with_passer(cloud: Array, count: int, rng: np.random.Generator) -> Trial:
    """The cloud, turned by 40 degrees, and as the last `count` points of both clouds something
    nearly as large that went elsewhere meanwhile."""
    passer = 0.6 * knot(count, rng)
    target = np.vstack([cloud, passer + np.array([1.0, 0.1, 0.3])])
    source = np.vstack([cloud, passer + np.array([-1.2, 0.8, -0.4])])
    away = motion(source, axis_rotation(rng.normal(size=3), np.radians(40)), rng)
    return Trial(apply(away, source), target, inverse(away))


def real_pair(data: Path, name: str, *, largest_deg: float = 180.0, seed: int = 0) -> Trial:
    """A pair of pairs.json by its id, as `real_trial`."""
    pairs = {pair["id"]: pair for pair in json.loads((data / "pairs.json").read_text())}
    return real_trial(data, pairs[name], largest_deg=largest_deg, seed=seed)


def real_trial(data: Path, pair: Pair, *, largest_deg: float = 180.0, seed: int = 0) -> Trial:
    """A pair in the shape of pairs.json, its source moved by a random motion seeded by the pair and
    the seed: turned evenly over SO(3), or by up to largest_deg, and moved by up to half the
    diagonal."""
    source, target = (points_of(data / pair[end]) for end in ("source", "target"))
    rng = np.random.default_rng([seed, *pair["id"].encode()])
    angle = np.radians(rng.uniform(0, largest_deg))
    R = random_rotation(rng) if largest_deg == 180 else axis_rotation(rng.normal(size=3), angle)
    T = motion(source, R, rng)
    return Trial(apply(T, source), target, true_pose(pair) @ inverse(T))


def random_rotation(rng: np.random.Generator) -> Array:
    """Return a (3, 3) rotation drawn evenly from SO(3): a normal quaternion, scaled to length 1."""
    w, x, y, z = rng.normal(size=4)
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def true_pose(pair: Pair) -> Array:
    """(4, 4) T_target_source of a pair in the shape of pairs.json."""
    T = np.array(pair["T_target_source"])
    # some published poses are printed to a few digits: take the nearest rotation
    T[:3, :3] = Rotation.from_matrix(T[:3, :3]).as_matrix()
    return T


def motion(cloud: Array, R: Array, rng: np.random.Generator) -> Array:
    """Turn by R about the centroid and move by up to half the diagonal."""
    centre, direction = cloud.mean(axis=0), rng.normal(size=3)
    length = rng.uniform(0, 0.5) * np.linalg.norm(np.ptp(cloud, axis=0))
    return pose(R, centre - R @ centre + length * direction / np.linalg.norm(direction))
