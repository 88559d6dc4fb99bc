"""Samples of the surface of a mesh, in place of its vertices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import (
    DecodedCloud,
    FileLimitError,
    MalformedFileError,
    ReadLimits,
    read_surface,
    write_cloud,
)
from service.formats.surface import MIN_DEFAULT_SAMPLES
from tests.factories.cloud_files import ply, text_rows
from tests.factories.decoding import write_file
from tests.factories.scanner_files import DOUBLES, glb, obj, off, stl_binary

UNEVEN = DecodedCloud(
    np.concatenate([[[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0.0]], np.full((97, 3), 5.0)]),
    "ply",
    attributes={"weight": np.r_[0.0, 1, 1, 0, np.ones(97)]},
    faces=np.concatenate([[[0, 1, 2], [0, 2, 3]], np.arange(4, 100)[:, None] + [0, 1, 0]]),
)
"""A square of two triangles, and most of the vertices at faces without area."""


@pytest.mark.parametrize(
    "content", [stl_binary(), obj(), off(), glb()], ids=["stl", "obj", "off", "glb"]
)
def test_samples_lie_evenly_on_the_triangles(tmp_path: Path, content: bytes) -> None:
    path = write_file(tmp_path, content)
    cloud = read_surface(path, surface_samples=5000)
    assert cloud.points.shape == (5000, 3)
    assert cloud.normals is not None
    np.testing.assert_array_equal(cloud.points, read_surface(path, surface_samples=5000).points)
    triangles = DOUBLES[:39].reshape(13, 3, 3)
    if not content.startswith(b"made by hand"):
        triangles = np.stack([DOUBLES[i : i + 3] for i in range(38)])
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    normals /= 2 * areas[:, None]
    heights = np.abs(np.einsum("td,ntd->nt", normals, cloud.points[:, None] - triangles[:, 0]))
    assert heights.min(axis=1).max() < 1e-4
    # the mean of the samples is that of the surface, to three standard errors
    centre = (areas / areas.sum()) @ triangles.mean(axis=1)
    error = cloud.points.std(axis=0) / np.sqrt(5000)
    assert (np.abs(cloud.points.mean(axis=0) - centre) < 3 * error).all()


@pytest.mark.parametrize("format", ["ply", "obj", "glb"])
def test_the_area_counts_and_not_the_vertices(tmp_path: Path, format: str) -> None:
    write_cloud(tmp_path / "mesh", format, UNEVEN)
    cloud = read_surface(tmp_path / "mesh")
    assert len(cloud.points) == MIN_DEFAULT_SAMPLES
    counts, _, _ = np.histogram2d(*cloud.points[:, :2].T, bins=5, range=[[0, 10], [0, 10]])
    np.testing.assert_allclose(counts, MIN_DEFAULT_SAMPLES / 25, rtol=0.15)
    assert any("inlier pairs number the samples" in text for text in cloud.warnings)
    assert cloud.mesh is not None
    assert cloud.mesh.faces is not None
    np.testing.assert_allclose(cloud.mesh.points, UNEVEN.points, atol=1e-6)


def test_weights_of_vertices_become_those_of_samples(tmp_path: Path) -> None:
    write_cloud(tmp_path / "mesh", "ply", UNEVEN)
    cloud = read_surface(tmp_path / "mesh", weights="weight")
    np.testing.assert_allclose(cloud.weights, cloud.points[:, 0] / 10, atol=1e-6)


def test_vertices_on_request(tmp_path: Path) -> None:
    cloud = read_surface(write_file(tmp_path, off()), surface_samples=0)
    np.testing.assert_allclose(cloud.points, DOUBLES, rtol=1e-6)
    assert cloud.mesh is None


def with_one_face(folder: Path, face: bytes) -> Path:
    rows = text_rows(DOUBLES.astype(np.float32))
    return write_file(folder, b"OFF\n40 1 0\n" + rows + face)


def test_faces_without_area_are_no_surface(tmp_path: Path) -> None:
    path = with_one_face(tmp_path, b"3 0 0 1\n")
    assert len(read_surface(path).points) == 40
    with pytest.raises(MalformedFileError, match="no faces with an area"):
        read_surface(path, surface_samples=100)


def test_faces_at_few_points_are_sampled_on_request(tmp_path: Path) -> None:
    path = with_one_face(tmp_path, b"3 0 1 2\n")
    cloud = read_surface(path)
    assert len(cloud.points) == 40
    assert "the points count, and not the surface" in cloud.warnings[-1]
    assert read_surface(path, surface_samples=100).mesh is not None


def test_a_cloud_without_faces_has_no_samples(tmp_path: Path) -> None:
    path = write_file(tmp_path, ply())
    assert len(read_surface(path).points) == len(read_surface(path, surface_samples=0).points)
    with pytest.raises(MalformedFileError, match="leave surface_samples out"):
        read_surface(path, surface_samples=10)


def test_samples_are_limited(tmp_path: Path) -> None:
    path = write_file(tmp_path, obj())
    with pytest.raises(FileLimitError):
        read_surface(path, ReadLimits(max_points=100), surface_samples=101)
    assert len(read_surface(path, ReadLimits(max_points=100)).points) == 100
