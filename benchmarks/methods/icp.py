"""Open3D: point-to-point ICP on all points."""

from __future__ import annotations

import numpy as np
import open3d as o3d

from benchmarks.methods.method import Array, Method, centered_start, diagonal, version_of


def run(source: Array, target: Array) -> Array:
    """Return the pose T_target_source that the method finds."""
    registration = o3d.pipelines.registration
    x, y = (o3d.geometry.PointCloud(o3d.utility.Vector3dVector(p)) for p in (source, target))
    result = registration.registration_icp(
        x,
        y,
        diagonal(target),
        centered_start(source, target),
        registration.TransformationEstimationPointToPoint(False),
        registration.ICPConvergenceCriteria(max_iteration=200),
    )
    return np.asarray(result.transformation)


ICP = Method(
    "ICP", version_of("open3d-cpu"), run, "point-to-point, every pair counts, 200 iterations"
)
