"""Clouds for Open3D's methods, downsampled as in its tutorials."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import open3d as o3d

from benchmarks.methods.method import Array, diagonal

Coarse = Callable[[Array, Array, int], Array]
"""A coarse registration of source and target with so many voxels to the diagonal."""

VOXELS = 50  # to the diagonal of the target
TUTORIAL_VOXELS = 61  # the tutorial's 0.05 m on the pair that it registers
AT_BEST = f"voxel = diagonal / {VOXELS}, ICP on clouds thinned to half of it"
AS_IN_THE_TUTORIAL = f"voxel = diagonal / {TUTORIAL_VOXELS}, as on its own pair, ICP on all points"


def voxel_size(target: Array, voxels: int = VOXELS) -> float:
    """Return the edge of voxels of which so many span the target's diagonal."""
    return diagonal(target) / voxels


def cloud(points: Array, voxel: float) -> o3d.geometry.PointCloud:
    """Downsample to one point a voxel, with normals from 30 neighbors within two voxels."""
    thinned = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(voxel)
    thinned.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=2 * voxel, max_nn=30))
    return thinned


def features(thinned: o3d.geometry.PointCloud, voxel: float) -> o3d.pipelines.registration.Feature:
    """Compute FPFH from 100 neighbors within five voxels."""
    return o3d.pipelines.registration.compute_fpfh_feature(
        thinned, o3d.geometry.KDTreeSearchParamHybrid(radius=5 * voxel, max_nn=100)
    )


def polish(source: Array, target: Array, T: Array) -> Array:
    """Run point-to-plane ICP on clouds of half the voxel, with pairs up to one voxel apart."""
    voxel = voxel_size(target)
    return _point_to_plane(cloud(source, voxel / 2), cloud(target, voxel / 2), voxel, T)


def at_best(coarse: Coarse, source: Array, target: Array) -> Array:
    """Run the coarse registration with the voxel that suits it best, and `polish`."""
    return polish(source, target, coarse(source, target, VOXELS))


def as_in_the_tutorial(coarse: Coarse, source: Array, target: Array) -> Array:
    """Run the coarse registration, then ICP on all points with pairs up to 0.4 voxels apart."""
    T, voxel = coarse(source, target, TUTORIAL_VOXELS), voxel_size(target, TUTORIAL_VOXELS)
    x, y = (o3d.geometry.PointCloud(o3d.utility.Vector3dVector(p)) for p in (source, target))
    y.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=2 * voxel, max_nn=30))
    return _point_to_plane(x, y, 0.4 * voxel, T)


def _point_to_plane(
    x: o3d.geometry.PointCloud, y: o3d.geometry.PointCloud, reach: float, T: Array
) -> Array:
    registration = o3d.pipelines.registration
    estimation = registration.TransformationEstimationPointToPlane()
    return np.asarray(registration.registration_icp(x, y, reach, T, estimation).transformation)
