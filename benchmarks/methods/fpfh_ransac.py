"""Open3D: RANSAC over FPFH matches, then ICP."""

from __future__ import annotations

import open3d as o3d

from benchmarks.methods.method import Array, Method
from benchmarks.methods.open3d_clouds import cloud, features, polish, voxel_size


def run(source: Array, target: Array) -> Array:
    o3d.utility.random.seed(0)
    registration, voxel = o3d.pipelines.registration, voxel_size(target)
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
    return polish(source, target, found.transformation)


FPFH_RANSAC = Method(
    "FPFH+RANSAC+ICP", "open3d-cpu", run, "tutorial's; voxel = diagonal / 50, mutual filter"
)
