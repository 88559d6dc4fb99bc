"""Trimmed ICP, from laid-together centroids."""

from __future__ import annotations

import numpy as np

from benchmarks.methods.method import Array, Method, version_of
from mpe_core.clouds.normalize import normalize_pair
from mpe_core.clouds.validate import validate_cloud
from mpe_core.geometry.nearest import NearestNeighbors
from mpe_core.paper.trimmed_icp import trimmed_icp


def run(source: Array, target: Array) -> Array:
    """Return the pose T_target_source that the method finds."""
    pair = normalize_pair(validate_cloud(source), validate_cloud(target))
    found = trimmed_icp(
        pair.source, NearestNeighbors(pair.target), np.eye(4), None, 200, lambda fraction: None
    )
    return pair.to_caller(found.T)


TRIMMED_ICP = Method("trimmed ICP", version_of("mpe"), run, "overlap searched, 200 iterations")
