"""Meshes as CAD programs write them: flat faces of few corners, and round parts of very many."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from service.formats import DecodedCloud

Array = NDArray[np.float64]
_BOXES = [
    ((0, 0, 0), (200, 120, 20)),
    ((-90, 0, 80), (20, 120, 140)),
    ((50, 30, 25), (50, 30, 30)),
    ((60, -30, 30), (24, 24, 40)),
]
"""Centres and sizes of the boxes of a bracket."""


def box(centre: tuple[float, ...], size: tuple[float, ...]) -> tuple[Array, NDArray[np.int64]]:
    """Return the corners (8, 3) and triangles (12, 3) of a box."""
    corners = np.array(list(product((-0.5, 0.5), repeat=3)))
    faces = []
    for axis, side in product(range(3), (-0.5, 0.5)):
        a, b, c, d = np.flatnonzero(corners[:, axis] == side)
        faces += [(a, b, c), (b, d, c)]
    return corners * size + centre, np.array(faces)


def thread(turns: int, steps: int) -> tuple[Array, NDArray[np.int64]]:
    """Return a wire around an axis, as the thread of a screw."""
    along = np.linspace(0, 2 * np.pi * turns, steps)
    around = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    r = 6 + 0.5 * np.cos(around)[None, :]
    x, y = r * np.cos(along)[:, None], r * np.sin(along)[:, None]
    z = 0.4 * along[:, None] + 0.5 * np.sin(around)[None, :]
    points = np.stack(np.broadcast_arrays(60 + x, y - 30, 50 + z), axis=2).reshape(-1, 3)
    i, j = np.mgrid[: steps - 1, :6]
    a, b = 6 * i + j, 6 * i + (j + 1) % 6
    faces = np.stack([a, b, a + 6, b, b + 6, a + 6], axis=2).reshape(-1, 3)
    return points, faces


def bracket(steps: int = 3000) -> DecodedCloud:
    """Return a bracket of 32 corners and a thread of 6 times `steps` vertices."""
    parts = [*(box(centre, size) for centre, size in _BOXES), thread(8, steps)]
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    faces = [faces + start for (_, faces), start in zip(parts, starts, strict=False)]
    return DecodedCloud(
        np.concatenate([points for points, _ in parts]), "obj", faces=np.concatenate(faces)
    )
