"""Distances from the triangles of a mesh: against brute force, and against Open3D's."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from mpe_core import CloudShapeError, MeshSurface, measure_deviation
from tests.factories.meshes import box

RNG = np.random.default_rng(8)


def dense_distances(points: NDArray[np.float64], triangles: NDArray[np.float64]) -> NDArray:
    """Distances (N, F), from the plane of each triangle above it, else from its sides."""
    a, b, c = triangles.transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = points[:, None] - a
    heights = np.einsum("nfi,fi->nf", offsets, normals)
    feet = points[:, None] - heights[:, :, None] * normals
    is_above, sides = np.ones(heights.shape, bool), []
    for start, end in ((a, b), (b, c), (c, a)):
        side = end - start
        is_above &= np.einsum("nfi,nfi->nf", np.cross(side, feet - start), normals[None]) >= 0
        shares = np.einsum("nfi,fi->nf", points[:, None] - start, side) / (side**2).sum(axis=1)
        on_side = start + np.clip(shares, 0, 1)[:, :, None] * side
        sides.append(np.linalg.norm(points[:, None] - on_side, axis=2))
    return np.where(is_above, np.abs(heights), np.min(sides, axis=0))


@pytest.mark.parametrize("count", [1, 3, 4, 5, 200])
def test_distances_are_those_of_every_triangle(count: int) -> None:
    triangles = RNG.normal(size=(count, 3, 3)) * RNG.choice([0.1, 1, 5], (count, 1, 1))
    points = RNG.normal(size=(300, 3)) * 3
    surface = MeshSurface(triangles.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    expected = dense_distances(points, triangles).min(axis=1)
    np.testing.assert_allclose(np.abs(surface.measure(points)), expected, rtol=0, atol=1e-12)


def test_signs_hold_at_edges_and_corners() -> None:
    corners, faces = box((5e6, 0, 0), (2, 4, 6))
    normals = np.cross(*(corners[faces[:, k]] - corners[faces[:, 0]] for k in (1, 2)))
    is_inward = np.einsum("fi,fi->f", normals, corners[faces[:, 0]] - corners.mean(axis=0)) < 0
    faces[is_inward] = faces[is_inward, ::-1]
    points = RNG.uniform(-5, 5, (2000, 3))
    beyond = np.abs(points) - np.array([1, 2, 3])
    outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
    expected = np.where(outside > 0, outside, beyond.max(axis=1))
    moved = points + np.array([5e6, 0, 0])
    found = measure_deviation(moved, corners, np.eye(4), target_faces=faces)
    assert found.is_signed
    np.testing.assert_allclose(found.distances, expected, rtol=0, atol=1e-8)
    inverted = measure_deviation(moved, corners, np.eye(4), target_faces=faces[:, ::-1])
    np.testing.assert_allclose(inverted.distances, -expected, rtol=0, atol=1e-8)
    faces[0] = faces[0, ::-1]
    unsigned = measure_deviation(moved, corners, np.eye(4), target_faces=faces)
    assert not unsigned.is_signed
    np.testing.assert_allclose(unsigned.distances, np.abs(expected), rtol=0, atol=1e-8)


def test_against_open3d() -> None:
    o3d = pytest.importorskip("open3d")
    mesh = o3d.geometry.TriangleMesh.create_torus(1.0, 0.3, 60, 40)
    points = RNG.uniform(-1.5, 1.5, (3000, 3)).astype(np.float32)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    expected = scene.compute_signed_distance(points).numpy()
    surface = MeshSurface(np.asarray(mesh.vertices), np.asarray(mesh.triangles))
    assert surface.is_signed
    np.testing.assert_allclose(surface.measure(points), expected, rtol=0, atol=2e-6)


def test_points_and_corners_that_are_not_finite() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [np.nan, 0, 0]])
    surface = MeshSurface(corners, [[0, 1, 2], [0, 1, 3], [0, 0, 1]])
    found = surface.measure(np.array([[0.2, 0.2, 3.0], [np.inf, 0, 0]]))
    np.testing.assert_allclose(found, [3.0, np.nan])


@pytest.mark.parametrize("faces", [[[0, 1, 9]], [[0, 0, 1]], [0, 1, 2], np.empty((0, 3), int)])
def test_what_is_no_mesh_is_refused(faces: object) -> None:
    with pytest.raises(CloudShapeError):
        MeshSurface(np.eye(3), faces)
