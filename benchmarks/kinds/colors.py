"""Intensity where the surfaces slide on themselves."""

from __future__ import annotations

import numpy as np

from benchmarks.kinds.case import Case, Maker
from tests.factories.painted import Painted, paint, road, tube, wall


def _colored(rng: np.random.Generator, source: Painted, target: Painted) -> Case:
    light = source[1] + rng.normal(0, 0.05, len(source[1]))
    return Case(source[0], target[0], colors=(light, 60 * target[1] - 400))


def _wall(rng: np.random.Generator) -> Case:
    pattern = paint(rng)
    return _colored(rng, wall(rng, pattern, 0), wall(rng, pattern, rng.uniform(0.5, 1.5)))


def _tube(rng: np.random.Generator) -> Case:
    return _colored(rng, tube(rng, 0), tube(rng, rng.uniform(1, 4)))


def _road(rng: np.random.Generator) -> Case:
    return _colored(rng, road(rng, 0), road(rng, rng.uniform(2, 8)))


COLORS: dict[str, Maker] = {
    "a painted wall": _wall,
    "a painted tube": _tube,
    "a road with markings": _road,
}
