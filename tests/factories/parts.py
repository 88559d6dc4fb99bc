"""Machine parts of which a small feature decides the turn, and models in views of a scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def shaft(count: int, rng: np.random.Generator, *, has_key: bool = True) -> Array:
    """Return a shaft 2 long of radius 0.2 with its ends; a key holds 2.3 % of its points."""
    angle, along = rng.uniform(0, 2 * np.pi, count), rng.uniform(-1, 1, count)
    body = np.column_stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), along])
    few = count // 20
    angle, r = rng.uniform(0, 2 * np.pi, few), 0.2 * np.sqrt(rng.random(few))
    ends = np.column_stack([r * np.cos(angle), r * np.sin(angle), rng.choice([-1.0, 1.0], few)])
    parts = [body, ends, _key(count // 40, rng)] if has_key else [body, ends]
    points = np.vstack(parts)
    return points + rng.normal(0, 0.0005, points.shape)


def _key(count: int, rng: np.random.Generator) -> Array:
    points = rng.uniform((0.19, -0.03, 0.35), (0.24, 0.03, 0.65), (count, 3))
    face = rng.integers(0, 4, count)
    points[face < 2, 0] = 0.24
    points[face == 2, 1], points[face == 3, 1] = -0.03, 0.03
    return points


def mug_on_table(count: int, rng: np.random.Generator) -> Array:
    """Return a table 2 by 1.6, and a mug off its middle with a handle: 5 % of the points."""
    table = rng.uniform(-1, 1, (count, 3)) * (1, 0.8, 0)
    few = count // 25
    angle, z = rng.uniform(0, 2 * np.pi, few), rng.uniform(0, 0.25, few)
    mug = np.column_stack([0.12 * np.cos(angle), 0.12 * np.sin(angle), z])
    few = count // 100
    angle, around = rng.uniform(-np.pi / 2, np.pi / 2, few), rng.uniform(0, 2 * np.pi, few)
    reach = 0.07 + 0.015 * np.cos(around)
    handle = np.column_stack(
        [0.12 + reach * np.cos(angle), 0.015 * np.sin(around), 0.125 + reach * np.sin(angle)]
    )
    place = np.array([0.3, -0.2, 0])
    points = np.vstack([table, mug + place, handle + place])
    return points + rng.normal(0, 0.001, points.shape)


def comb(rng: np.random.Generator, start: float, teeth: int = 9) -> Array:
    """Return a wall with equal teeth 1 apart, from the tooth `start`, and the floor before it."""
    x, z = rng.uniform(start, start + teeth, 9000), rng.uniform(0, 3, 9000)
    wall = np.column_stack([x, np.where(np.abs(x % 1 - 0.5) < 0.2, 0.3, 0.0), z])
    along, out = rng.uniform(start, start + teeth, 3000), -rng.uniform(0, 2, 3000)
    return np.vstack([wall, np.column_stack([along, out, np.zeros(3000)])])


def bumpy_ball(count: int, seed: int, rng: np.random.Generator) -> Array:
    """Return random points of a ball of radius about 0.5 whose bumps follow from the seed."""
    shape = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    heights, waves = shape.uniform(0.05, 0.2, 6), 3 * shape.normal(size=(6, 3))
    phases = shape.uniform(0, 6, 6)
    bumps = (heights * np.sin(np.einsum("ni,ki->nk", points, waves) + phases)).sum(axis=1)
    return 0.5 * points * (1 + bumps)[:, None]


def angle_bracket(count: int, rng: np.random.Generator) -> Array:
    """Return a plate 1.2 by 0.6 with an upright at one end and a round boss."""
    boss = count // 5
    angle = rng.uniform(0, 2 * np.pi, boss)
    r = np.where(np.arange(boss) % 2, 0.15, 0.15 * np.sqrt(rng.random(boss)))
    z = np.where(np.arange(boss) % 2, rng.uniform(0.05, 0.3, boss), 0.3)
    return np.vstack(
        [
            _box((0, 0, 0), (1.2, 0.6, 0.1), count // 2, rng),
            _box((-0.55, 0, 0.35), (0.1, 0.6, 0.7), count - boss - count // 2, rng),
            np.column_stack([0.3 + r * np.cos(angle), r * np.sin(angle), z]),
        ]
    )


def _box(
    centre: tuple[float, ...], size: tuple[float, ...], count: int, rng: np.random.Generator
) -> Array:
    extent = np.array(size)
    areas = extent.prod() / extent
    face = rng.choice(3, count, p=areas / areas.sum())
    points = rng.uniform(-0.5, 0.5, (count, 3))
    points[np.arange(count), face] = rng.choice([-0.5, 0.5], count)
    return points * extent + centre


def lay_on_table(part: Array, others: list[Array], rng: np.random.Generator) -> Array:
    """Return the points of a table 3.2 wide, of a part on it, and of others around that."""
    table = np.column_stack([rng.uniform(-1.6, 1.6, (60_000, 2)), np.zeros(60_000)])
    around = [
        other + np.array([0.95 * np.cos(a), 0.95 * np.sin(a), -other[:, 2].min()])
        for other, a in zip(others, rng.uniform(0, 2 * np.pi, len(others)), strict=True)
    ]
    return np.vstack([part - np.array([0, 0, part[:, 2].min()]), table, *around])


def seen_from(points: Array, eye: Array, pixel: float = 0.006, behind: float = 0.04) -> Array:
    """Return the points (N, 3) that a depth camera at `eye` sees which looks at the origin.

    Parameters
    ----------
    points
        Points of the scene, several a pixel.
    eye
        (3,) position of the camera.
    pixel
        Angle of a pixel in radians.
    behind
        Distance behind the nearest point of a pixel up to which others are seen.
    """
    away = points - eye
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    depth = away @ forward
    columns = np.floor(away @ right / depth / pixel).astype(np.int64)
    rows = np.floor(away @ np.cross(forward, right) / depth / pixel).astype(np.int64)
    _, pixels = np.unique(columns * 1_000_003 + rows, return_inverse=True)
    nearest = np.full(pixels.max() + 1, np.inf)
    distance = np.linalg.norm(away, axis=1)
    np.minimum.at(nearest, pixels, distance)
    return points[distance < nearest[pixels] + behind]
