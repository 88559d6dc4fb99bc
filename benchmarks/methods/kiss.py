"""KISS-Matcher, then ICP."""

from __future__ import annotations

from functools import partial

import kiss_matcher
import numpy as np

from benchmarks.methods.method import Array, Method, diagonal, version_of
from benchmarks.methods.open3d_clouds import polish

VOXEL = 0.3  # its example's; voxels under 0.005 are refused, so the clouds are scaled to it
EXAMPLE_VOXELS = 50
VOXELS = 100  # to the diagonal; 21 real pairs, within 15 degrees: 30 voxels 4, 40 5, 50 13, 100 17


def _run(voxels: int, source: Array, target: Array) -> Array:
    scale = voxels * VOXEL / diagonal(target)
    origin = target.mean(axis=0)
    matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(VOXEL))
    found = matcher.estimate(
        ((source - origin) * scale).astype(np.float32),
        ((target - origin) * scale).astype(np.float32),
    )
    T = np.eye(4)
    T[:3, :3] = found.rotation
    T[:3, 3] = np.asarray(found.translation) / scale + origin - T[:3, :3] @ origin
    return polish(source, target, T)


KISS = Method(
    "KISS-Matcher+ICP",
    version_of("kiss-matcher"),
    partial(_run, VOXELS),
    "voxel = diagonal / 100, the best of four, all threads",
)
KISS_EXAMPLE = Method(
    "KISS-Matcher+ICP, example",
    version_of("kiss-matcher"),
    partial(_run, EXAMPLE_VOXELS),
    "voxel = diagonal / 50",
)
