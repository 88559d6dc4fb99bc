"""KISS-Matcher, then ICP."""

from __future__ import annotations

import kiss_matcher
import numpy as np

from benchmarks.methods.method import Array, Method, diagonal
from benchmarks.methods.open3d_clouds import polish

VOXEL = 0.3  # its default; voxels under 0.005 are refused, so the clouds are scaled to it
VOXELS = 100  # to the diagonal; 21 real pairs, within 15 degrees: 30 voxels 4, 40 5, 50 13, 100 17


def run(source: Array, target: Array) -> Array:
    scale = VOXELS * VOXEL / diagonal(target)
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


KISS = Method("KISS-Matcher+ICP", "kiss-matcher", run, "defaults; voxel = diagonal / 100")
