"""Faces and attributes of VTK files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import ReadLimits, read_points, read_surface
from service.formats.vtk.cells import cut_cells
from tests.factories.cloud_files import NORMALS, POINTS
from tests.factories.decoding import write_file
from tests.factories.vtk_files import (
    ATTRIBUTES,
    POLYGONS,
    STRIP,
    legacy_mesh,
    solid_grid,
    xml_mesh,
)

MESHES = {
    "text": legacy_mesh(binary=False, new=False),
    "text 5.1": legacy_mesh(binary=False, new=True),
    "binary": legacy_mesh(binary=True, new=False),
    "binary 5.1": legacy_mesh(binary=True, new=True),
    "xml": xml_mesh(),
}


@pytest.mark.parametrize("name", MESHES)
def test_faces_and_attributes_are_kept(tmp_path: Path, name: str) -> None:
    cloud = read_points(write_file(tmp_path, MESHES[name]), attributes=True)
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert cloud.warnings == ()
    assert cloud.normals is not None
    np.testing.assert_array_equal(cloud.normals, NORMALS)
    assert cloud.faces is not None
    np.testing.assert_array_equal(cloud.faces[:2], POLYGONS)
    for triangle, first in zip(cloud.faces[2:].tolist(), STRIP[:38].tolist(), strict=True):
        assert triangle == [first + first % 2, first + 1 - first % 2, first + 2]
    kept = cloud.attributes
    np.testing.assert_array_equal(kept["my intensity"], ATTRIBUTES["my intensity"])
    np.testing.assert_array_equal(kept["ids"], ATTRIBUTES["ids"])
    colors = np.stack([kept[part] for part in ("red", "green", "blue")], axis=1)
    np.testing.assert_array_equal(colors, ATTRIBUTES["RGB"])
    assert colors.dtype == np.uint8
    np.testing.assert_array_equal(kept["gradient:2"], POINTS[:, 0])
    assert set(kept) == {
        *("my intensity", "ids", "red", "green", "blue"),
        *(f"gradient:{i}" for i in range(3)),
    }


@pytest.mark.parametrize("name", MESHES)
def test_a_mesh_is_sampled_by_area(tmp_path: Path, name: str) -> None:
    cloud = read_surface(write_file(tmp_path, MESHES[name]))
    assert cloud.mesh is not None
    assert set(cloud.brightness) == {"color"}


def test_solid_cells_count_with_their_outside(tmp_path: Path) -> None:
    cloud = read_points(write_file(tmp_path, solid_grid()), faces=True)
    assert cloud.faces is not None
    first, second, third = (cloud.points[corners] for corners in cloud.faces.T)
    areas = np.cross(second - first, third - first) / 2
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(10)
    # all look outwards, so that they enclose the volume
    assert np.einsum("ij,ij->", first, areas) / 3 == pytest.approx(2)


def test_flat_cells() -> None:
    pixel, quad = np.arange(4), np.arange(4, 8)
    corners = np.concatenate([pixel, quad, [8, 9]])
    faces = cut_cells(corners, np.array([4, 4, 2]), np.array([8, 9, 3]), POINTS)
    np.testing.assert_array_equal(faces, [[0, 1, 3], [0, 3, 2], [4, 5, 6], [4, 6, 7]])


@pytest.mark.parametrize("name", ["text", "binary 5.1"])
def test_damage_behind_the_points_is_a_warning(tmp_path: Path, name: str) -> None:
    cut = MESHES[name][: MESHES[name].index(b"POLYGONS") + 30]
    cloud = read_points(write_file(tmp_path, cut), attributes=True)
    assert "what follows is not kept" in cloud.warnings[0]
    np.testing.assert_array_equal(cloud.points, POINTS)
    wrong = legacy_mesh(binary=False, new=False).replace(b" 39\nCELL", b" 40\nCELL")
    cloud = read_points(write_file(tmp_path, wrong), attributes=True)
    assert cloud.faces is None
    assert "a face refers to a vertex that does not exist" in cloud.warnings[0]


def test_a_large_mesh_comes_without_faces(tmp_path: Path) -> None:
    cloud = read_points(write_file(tmp_path, MESHES["text"]), ReadLimits(max_points=20), faces=True)
    assert cloud.faces is None
    assert len(cloud.points) <= 20
    assert any("because the file is large" in text for text in cloud.warnings)
