"""Distances from the target's surface: against exact ones, and against Open3D's."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from mpe_core import TargetSurface, measure_deviation

RNG = np.random.default_rng(4)
HEIGHTS = (-0.02, 0.0, 0.003, 0.05)


def on_sphere(count: int) -> NDArray[np.float64]:
    points = RNG.normal(size=(count, 3))
    normalized: NDArray[np.float64] = points / np.linalg.norm(points, axis=1, keepdims=True)
    return normalized


SPHERE = on_sphere(40_000)


@pytest.mark.parametrize("height", HEIGHTS)
def test_distance_from_a_sphere_is_exact_and_signed(height: float) -> None:
    points = (1 + height) * on_sphere(2000)
    found = measure_deviation(points, SPHERE, np.eye(4), target_normals=SPHERE)
    assert found.is_signed
    np.testing.assert_allclose(found.distances, height, atol=8e-4)
    inside_out = measure_deviation(points, SPHERE, np.eye(4), target_normals=-SPHERE)
    np.testing.assert_allclose(inside_out.distances, -found.distances)


def test_a_viewpoint_says_which_side_is_outside() -> None:
    near = SPHERE[SPHERE[:, 2] > 0.5]
    found = measure_deviation(1.01 * near, near, np.eye(4), target_viewpoint=(0, 0, 5))
    assert (found.distances > 0).all()
    unsigned = measure_deviation(0.99 * near, near, np.eye(4))
    assert not unsigned.is_signed
    assert (unsigned.distances >= 0).all()


def test_beyond_the_edge_the_nearest_point_counts() -> None:
    x, y = RNG.uniform(0, 1, (2, 5000))
    square = np.column_stack([x, y, 0 * x])
    (distance,) = measure_deviation([[3.0, 0.5, 0.0]], square, np.eye(4)).distances
    assert distance == pytest.approx(2.0, abs=0.05)


def test_lines_and_clouds_without_surface_have_distances_too() -> None:
    beam = np.column_stack([np.arange(500) / 100, np.zeros(500), np.zeros(500)])
    (distance,) = measure_deviation([[2.0, 0.3, 0.4]], beam, np.eye(4)).distances
    assert distance == pytest.approx(0.5)


def test_few_points_and_rows_that_are_not_finite() -> None:
    target = np.array([[0.0, 0, 0], [1, 0, 0], [np.nan, 0, 0]])
    found = measure_deviation([[0, 0, 2.0], [np.inf, 0, 0]], target, np.eye(4)).distances
    np.testing.assert_allclose(found, [2.0, np.nan])
    assert np.isnan(TargetSurface(np.empty((0, 3))).measure(np.zeros((1, 3)))).all()


def test_statistics_are_those_of_numpy() -> None:
    found = measure_deviation(1.01 * on_sphere(500), SPHERE, np.eye(4), target_normals=SPHERE)
    values = found.distances
    summary = found.summarize((0.005, 0.02))
    assert (summary.count, summary.beyond) == (500, 0)
    assert summary.mean == pytest.approx(values.mean())
    assert summary.rms == pytest.approx(np.hypot(summary.mean, summary.std))
    assert summary.percentiles[95] == pytest.approx(np.percentile(values, 95))
    assert summary.shares == {0.005: 0.0, 0.02: 1.0}
    assert found.summarize((), max_distance=0.005).beyond == 500


def test_against_open3d() -> None:
    """Never more than the distance between clouds, and close to that from the mesh."""
    o3d = pytest.importorskip("open3d")
    mesh = o3d.geometry.TriangleMesh.create_torus(1.0, 0.3, 60, 40)
    o3d.utility.random.seed(1)
    target = np.asarray(mesh.sample_points_uniformly(40_000).points)
    source = target[::20] + RNG.normal(0, 0.01, (2000, 3))
    found = measure_deviation(source, target, np.eye(4)).distances
    clouds = [o3d.geometry.PointCloud(o3d.utility.Vector3dVector(c)) for c in (source, target)]
    between = np.asarray(clouds[0].compute_point_cloud_distance(clouds[1]))
    assert (found <= between + 1e-12).all()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    from_mesh = scene.compute_distance(source.astype(np.float32)).numpy()
    error = np.abs(found - from_mesh)
    assert np.sqrt(np.mean(error**2)) < 0.002
    assert np.sqrt(np.mean((between - from_mesh) ** 2)) > 5 * np.sqrt(np.mean(error**2))
