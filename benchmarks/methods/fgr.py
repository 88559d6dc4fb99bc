"""Open3D: fast global registration over FPFH matches, then ICP."""

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
    registration, voxel = o3d.pipelines.registration, voxel_size(target, voxels)
    x, y = cloud(source, voxel), cloud(target, voxel)
    found = registration.registration_fgr_based_on_feature_matching(
        x,
        y,
        features(x, voxel),
        features(y, voxel),
        registration.FastGlobalRegistrationOption(maximum_correspondence_distance=0.5 * voxel),
    )
    return found.transformation


FGR = Method("FPFH+FGR+ICP", version_of("open3d-cpu"), partial(at_best, _coarse), AT_BEST)
FGR_TUTORIAL = Method(
    "FPFH+FGR+ICP, tutorial",
    version_of("open3d-cpu"),
    partial(as_in_the_tutorial, _coarse),
    AS_IN_THE_TUTORIAL,
)
