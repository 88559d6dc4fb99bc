"""Open3D: fast global registration over FPFH matches, then ICP."""

from __future__ import annotations

import open3d as o3d

from benchmarks.methods.method import Array, Method
from benchmarks.methods.open3d_clouds import cloud, features, polish, voxel_size


def run(source: Array, target: Array) -> Array:
    registration, voxel = o3d.pipelines.registration, voxel_size(target)
    x, y = cloud(source, voxel), cloud(target, voxel)
    found = registration.registration_fgr_based_on_feature_matching(
        x,
        y,
        features(x, voxel),
        features(y, voxel),
        registration.FastGlobalRegistrationOption(maximum_correspondence_distance=0.5 * voxel),
    )
    return polish(source, target, found.transformation)


FGR = Method("FPFH+FGR+ICP", "open3d-cpu", run, "tutorial's; voxel = diagonal / 50")
