"""Open3D: RANSAC over FPFH matches, then ICP."""

from __future__ import annotations

from functools import partial

import open3d as o3d

from benchmarks.methods.method import Array, Method, version_of
from benchmarks.methods.open3d_clouds import (
    AS_IN_THE_TUTORIAL,
    AT_BEST,
    as_in_the_tutorial,
    at_best,
    cloud,
    features,
    voxel_size,
)


def _coarse(source: Array, target: Array, voxels: int) -> Array:
    o3d.utility.random.seed(0)
    registration, voxel = o3d.pipelines.registration, voxel_size(target, voxels)
    x, y = cloud(source, voxel), cloud(target, voxel)
    reach = 1.5 * voxel
    found = registration.registration_ransac_based_on_feature_matching(
        x,
        y,
        features(x, voxel),
        features(y, voxel),
        True,
        reach,
        registration.TransformationEstimationPointToPoint(False),
        3,
        [
            registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
            registration.CorrespondenceCheckerBasedOnDistance(reach),
        ],
        registration.RANSACConvergenceCriteria(100_000, 0.999),
    )
    return found.transformation


FPFH_RANSAC = Method(
    "FPFH+RANSAC+ICP",
    version_of("open3d-cpu"),
    partial(at_best, _coarse),
    f"mutual filter, 100,000 iterations, {AT_BEST}",
)
FPFH_RANSAC_TUTORIAL = Method(
    "FPFH+RANSAC+ICP, tutorial",
    version_of("open3d-cpu"),
    partial(as_in_the_tutorial, _coarse),
    f"mutual filter, 100,000 iterations, {AS_IN_THE_TUTORIAL}",
)
