"""Symmetric shapes, which more than one pose lays on themselves; random points (N, 3)."""

from __future__ import annotations

import numpy as np

from tests.factories.clouds import Array

POINTS = 6000


def ball(rng: np.random.Generator) -> Array:
    """Return random points of the surface of a ball."""
    v = rng.normal(size=(POINTS, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def tube(rng: np.random.Generator) -> Array:
    """Return random points of an open circular tube."""
    angle = rng.uniform(0, 2 * np.pi, POINTS)
    return np.column_stack([0.4 * np.cos(angle), 0.4 * np.sin(angle), rng.uniform(-1, 1, POINTS)])


def torus(rng: np.random.Generator) -> Array:
    """Return random points of a torus."""
    around, across = rng.uniform(0, 2 * np.pi, (2, POINTS))
    radius = 1 + 0.3 * np.cos(across)
    return np.column_stack([radius * np.cos(around), radius * np.sin(around), 0.3 * np.sin(across)])


def cube(rng: np.random.Generator) -> Array:
    """Return random points of the surface of a cube."""
    points = rng.uniform(-1, 1, (POINTS, 3))
    points[np.arange(POINTS), rng.integers(0, 3, POINTS)] = rng.choice([-1.0, 1.0], POINTS)
    return points


def plate(rng: np.random.Generator) -> Array:
    """Return random points of a flat rectangle."""
    return np.column_stack([rng.uniform(-1, 1, (POINTS, 2)) * (1, 0.6), np.zeros(POINTS)])


SHAPES = (ball, tube, torus, cube, plate)
