"""Clouds for Open3D's methods, thinned as its tutorials do."""

from __future__ import annotations

import numpy as np
import open3d as o3d

from benchmarks.methods.method import Array, diagonal

VOXELS = 50  # to the diagonal of the target


def voxel_size(target: Array) -> float:
    return diagonal(target) / VOXELS


def cloud(points: Array, voxel: float) -> o3d.geometry.PointCloud:
    """Thinned to one point a voxel, with normals from 30 neighbours within two voxels."""
    thinned = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(voxel)
    thinned.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=2 * voxel, max_nn=30))
    return thinned


def features(thinned: o3d.geometry.PointCloud, voxel: float) -> o3d.pipelines.registration.Feature:
    """FPFH from 100 neighbours within five voxels."""
    return o3d.pipelines.registration.compute_fpfh_feature(
        thinned, o3d.geometry.KDTreeSearchParamHybrid(radius=5 * voxel, max_nn=100)
    )


def polish(source: Array, target: Array, T: Array) -> Array:
    """Point-to-plane ICP on clouds thinned to half the voxel, pairs up to one voxel apart."""
    voxel = voxel_size(target)
    registration = o3d.pipelines.registration
    result = registration.registration_icp(
        cloud(source, voxel / 2),
        cloud(target, voxel / 2),
        voxel,
        T,
        registration.TransformationEstimationPointToPlane(),
    )
    return np.asarray(result.transformation)
