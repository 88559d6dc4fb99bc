"""Models in views of a scene, and small features that decide."""

from __future__ import annotations

import numpy as np

from benchmarks.kinds.case import Array, Case, Maker
from mpe_core.geometry.rigid import apply, pose
from tests.factories.clouds import random_rotation
from tests.factories.parts import (
    angle_bracket,
    bumpy_ball,
    lay_on_table,
    mug_on_table,
    seen_from,
    shaft,
)

POINTS_OF_VIEW = 25_000


def _part(seed: int, count: int, rng: np.random.Generator) -> Array:
    """One of two parts, the same shape for a seed."""
    return bumpy_ball(count, seed, rng) if seed % 2 else angle_bracket(count, rng)


def _view(rng: np.random.Generator, others: int, *, shows_model: bool = True) -> Case:
    seed = int(rng.integers(1 << 30))
    turn = pose(random_rotation(rng), np.zeros(3))
    low = apply(turn, _part(seed, 40_000, rng))
    lift = pose(np.eye(3), np.array([0, 0, -low[:, 2].min()]))
    around = [bumpy_ball(20_000, seed + k, rng) * 0.7 for k in range(1, others + 1)]
    shown = low if shows_model else 0.8 * bumpy_ball(40_000, seed + 99, rng)
    rise, turned = rng.uniform(0.5, 1.1), rng.uniform(0, 2 * np.pi)
    eye = 4 * np.array([np.cos(rise) * np.cos(turned), np.cos(rise) * np.sin(turned), np.sin(rise)])
    seen = seen_from(lay_on_table(shown, around, rng), eye)
    seen = rng.permutation(seen)[:POINTS_OF_VIEW]
    there = apply(lift, apply(turn, _part(seed, 12_000, rng)))
    return Case(there, seen + rng.normal(0, 0.0015, seen.shape), fits=shows_model)


def _in_view(rng: np.random.Generator) -> Case:
    return _view(rng, 0)


def _in_clutter(rng: np.random.Generator) -> Case:
    return _view(rng, 3)


def _not_in_view(rng: np.random.Generator) -> Case:
    return _view(rng, 2, shows_model=False)


def _keyed_shaft(rng: np.random.Generator) -> Case:
    return Case(shaft(20_000, rng), shaft(20_000, rng))


def _plain_shaft(rng: np.random.Generator) -> Case:
    plain = (shaft(20_000, rng, has_key=False) for _ in range(2))
    return Case(*plain, fits=False)


def _mug(rng: np.random.Generator) -> Case:
    return Case(mug_on_table(20_000, rng), mug_on_table(20_000, rng))


PARTS: dict[str, Maker] = {
    "a model in one view": _in_view,
    "a model in one view among three others": _in_clutter,
    "a model that the view does not show": _not_in_view,
    "a shaft with a key": _keyed_shaft,
    "a shaft without a key": _plain_shaft,
    "a mug on a table, 5 % of the points": _mug,
}
