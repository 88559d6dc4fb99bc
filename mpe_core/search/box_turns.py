"""Turns that lay the directions of a room, a carton or a street on each other.

Walls, floors and shelves lie along three directions at right angles. Turned by a quarter or a half
about one of them, much of such a scene fits on itself: what is found may be such a turn away from
the truth, which the first candidates of a search need not hold.
"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.surface import Surface
from mpe_core.geometry.sampling import take_every

Array = NDArray[np.float64]

SUBSET_POINTS = 400
"""Points, or up to twice as many, whose normals tell the directions."""

ALONG_DEG, MIN_SHARE = 15.0, 0.5
"""Angle up to which a normal lies along a direction, and share of the normals that do so."""

MIN_COSINE, MAX_CROSS_COSINE = np.cos(np.radians(ALONG_DEG)), np.sin(np.radians(ALONG_DEG))
"""Cosine between a normal and a direction that it lies along, and across."""

MIN_SECOND_SHARE = 0.1
"""Share of the normals along the second direction: else turns about the first are not of a box."""


def box_turns(surface: Surface) -> Array:
    """Find the turns by quarters and halves about the three directions of a surface.

    Returns
    -------
    (23, 3, 3) rotations of the surface in place; (0, 3, 3) where its normals have no such
    directions.
    """
    normals = take_every(surface.normals[surface.weights > 0], SUBSET_POINTS).astype(np.float64)
    normals = normals[np.square(normals).sum(axis=1) > 0.5]
    axes = _box_axes(normals) if len(normals) else None
    if axes is None:
        return np.empty((0, 3, 3))
    turns = [
        np.array(signs)[:, None] * np.eye(3)[list(order)]
        for order in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    ]
    turns = [Q for Q in turns if np.linalg.det(Q) > 0 and np.trace(Q) < 2.5]
    rotations: Array = np.einsum("ij,kjl,ml->kim", axes, np.array(turns), axes)
    return rotations


def _box_axes(normals: Array) -> Array | None:
    """(3, 3) directions as columns, of which most normals (N, 3) lie along one."""
    first = _commonest(normals)
    across = normals[np.abs(normals @ first) < MAX_CROSS_COSINE]
    if len(across) < MIN_SECOND_SHARE * len(normals):
        return None
    second = _commonest(across)
    second -= (second @ first) * first
    second /= np.linalg.norm(second)
    axes = np.column_stack([first, second, np.cross(first, second)])
    share = (np.abs(normals @ axes).max(axis=1) > MIN_COSINE).mean()
    return axes if share >= MIN_SHARE else None


def _commonest(normals: Array) -> Array:
    """(3,) mean of the normals along the one of the normals (N, 3) that most lie along."""
    cosines = normals @ normals.T
    is_along = np.abs(cosines) > MIN_COSINE
    best = int(np.argmax(is_along.sum(axis=1)))
    near = is_along[best]
    mean = (np.sign(cosines[best, near])[:, None] * normals[near]).mean(axis=0)
    unit: Array = mean / np.linalg.norm(mean)
    return unit
