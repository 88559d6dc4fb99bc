"""Few points, flat outlines, and solids of points."""

from __future__ import annotations

import numpy as np

from benchmarks.kinds.case import Array, Case, Maker


def _markers(rng: np.random.Generator) -> Case:
    points = rng.uniform(-1, 1, (rng.integers(6, 60), 3))
    return Case(points, rng.permutation(points))


def _other_markers(rng: np.random.Generator) -> Case:
    count = rng.integers(6, 60)
    return Case(rng.uniform(-1, 1, (count, 3)), rng.uniform(-1, 1, (count, 3)), fits=False)


def _volume(rng: np.random.Generator) -> Array:
    count = rng.integers(1001, 6000)
    if rng.random() < 0.5:
        return rng.normal(0, 0.4, (count, 3))
    return rng.uniform(-1, 1, (count, 3)) * rng.uniform(0.4, 1, 3)


def _volumes(rng: np.random.Generator) -> Case:
    points = _volume(rng)
    source = rng.permutation(points)[: 2 * len(points) // 3]
    return Case(source, points)


def _other_volumes(rng: np.random.Generator) -> Case:
    return Case(_volume(rng), _volume(rng), fits=False)


def _outline(rng: np.random.Generator, count: int) -> Array:
    t = np.linspace(0, 2 * np.pi, count, endpoint=False)
    size, phase = rng.normal(0, 0.3, 6) / np.arange(1, 7), rng.uniform(0, 6, 6)
    waves = size[:, None] * np.cos(np.arange(1, 7)[:, None] * t + phase[:, None])
    r = 1 + waves.sum(axis=0)
    return np.column_stack([r * np.cos(t), r * np.sin(t), 0 * t])


def _outlines(rng: np.random.Generator) -> Case:
    source = _outline(rng, 1200)
    return Case(source[::3], source[1::2])


def _other_outlines(rng: np.random.Generator) -> Case:
    return Case(_outline(rng, 600), _outline(rng, 500), fits=False)


FEW: dict[str, Maker] = {
    "6 to 60 markers": _markers,
    "unlike markers": _other_markers,
    "volumes of points": _volumes,
    "unlike volumes": _other_volumes,
    "outlines": _outlines,
    "unlike outlines": _other_outlines,
}
