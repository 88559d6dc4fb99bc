"""small_gicp: generalised ICP."""

from __future__ import annotations

import numpy as np
import small_gicp

from benchmarks.methods.method import Array, Method, centered_start, diagonal, version_of


def run(source: Array, target: Array) -> Array:
    """Return the pose T_target_source that the method finds."""
    scale = 1 / diagonal(target)
    origin = target.mean(axis=0)
    x, y = (source - origin) * scale, (target - origin) * scale
    found = small_gicp.align(
        y,
        x,
        centered_start(x, y),
        downsampling_resolution=0.01,
        max_correspondence_distance=0.2,
        num_threads=2,
        max_iterations=100,
    )
    T = np.array(found.T_target_source)
    T[:3, 3] = T[:3, 3] / scale + origin - T[:3, :3] @ origin
    return T


GICP = Method(
    "GICP",
    version_of("small-gicp"),
    run,
    "voxel = diagonal / 100, pairs up to a fifth of it, 100 iterations",
)
