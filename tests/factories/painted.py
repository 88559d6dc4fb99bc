"""Surfaces with a pattern of brightness: walls, roads with markings, tubes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Painted = tuple[Array, Array]
"""Points (N, 3) and brightness (N,)."""


def paint(rng: np.random.Generator, count: int = 40) -> Callable[[Array], Array]:
    """Return a random pattern of waves 0.6 to 4 long, in [0, 1], over places (N, 2)."""
    turn, wave = rng.uniform(0, 2 * np.pi, count), rng.uniform(0.8, 5, count)
    k, phase = wave * np.array([np.cos(turn), np.sin(turn)]), rng.uniform(0, 2 * np.pi, count)
    return lambda places: np.clip(
        0.5 + 0.5 * np.cos(places @ k + phase).sum(axis=1) / np.sqrt(count), 0, 1
    )


def wall(
    rng: np.random.Generator, pattern: Callable[[Array], Array], start: float, count: int = 12_000
) -> Painted:
    """Return four metres of a wall three metres high, from `start` on."""
    places = rng.uniform((start, 0), (start + 4, 3), (count, 2))
    return np.column_stack([places, rng.normal(0, 0.003, count)]), pattern(places)


def road(rng: np.random.Generator, start: float, count: int = 30_000) -> Painted:
    """Return thirty metres of a flat road with markings, from `start` on."""
    x, y = rng.uniform((start, 0), (start + 30, 8), (count, 2)).T
    edge, dash = np.abs(y - 0.6) < 0.1, (np.abs(y - 4) < 0.1) & (x % 9 < 4)
    zebra = (np.abs(x - 15) < 1.5) & (y % 1 < 0.5)
    arrow = (np.abs(y - 6) < np.clip(24 - x, 0, 3) / 6) & (x > 20)
    points = np.column_stack([x, y, rng.normal(0, 0.01, count)])
    return points, np.where(edge | dash | zebra | arrow, 0.9, 0.25)


def tube(rng: np.random.Generator, start: float, count: int = 20_000) -> Painted:
    """Return twelve metres of a painted tube of radius 2, from `start` on."""
    a, x = rng.uniform((0, start), (2 * np.pi, start + 12), (count, 2)).T
    waves = np.cos(1.3 * x + 2 * np.cos(a) + 1) + np.cos(2 * a + 0.9 * x) + np.sin(3 * a - 2.1 * x)
    points = np.column_stack([x, 2 * np.cos(a), 2 * np.sin(a)])
    return points + rng.normal(0, 0.005, points.shape), waves / 6 + 0.5
