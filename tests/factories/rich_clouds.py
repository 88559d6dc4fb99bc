"""Clouds with every kind of attribute, for tests of writers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from service.formats import DecodedCloud

COUNT = 200


def rich_cloud(seed: int = 3) -> DecodedCloud:
    """Coordinates of a map, normals, colours, intensity, class, returns, time, and a scalar."""
    rng = np.random.default_rng(seed)
    points = np.round(rng.uniform(-50, 50, (COUNT, 3)) + np.array([5e5, 4.6e6, 120]), 3)
    normals = rng.normal(size=(COUNT, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    attributes: dict[str, NDArray[np.generic]] = {
        **dict(zip(("nx", "ny", "nz"), normals.astype(np.float32).T, strict=True)),
        **{name: rng.integers(0, 256, COUNT).astype(np.uint8) for name in ("red", "green", "blue")},
        "intensity": rng.integers(0, 65536, COUNT).astype(np.uint16),
        "classification": rng.integers(0, 20, COUNT).astype(np.uint8),
        "return_number": rng.integers(1, 6, COUNT).astype(np.uint8),
        "gps_time": 3e8 + np.arange(COUNT) / 8,
        "roughness": rng.normal(size=COUNT).astype(np.float32),
        "X": rng.integers(0, 1000, COUNT).astype(np.int32),
    }
    faces = rng.permuted(np.tile(np.arange(COUNT), (60, 1)), axis=1)[:, :3].astype(np.int64)
    return DecodedCloud(points, "ply", attributes=attributes, faces=faces)
