"""Normals and attributes of glTF: of meshes and of points, turned as the nodes turn them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.formats import UnsupportedFileError, read_points, write_cloud
from tests.factories.decoding import write_file
from tests.factories.gltf import glb_file, scene_of
from tests.factories.rich_clouds import rich_cloud

CORNERS = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0]], "<f4")
NORMALS = np.array([[0, 0, 1], [0, 0.6, 0.8], [0.6, 0, 0.8]], "<f4")
QUARTER = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
"""About z, as a quaternion x, y, z, w."""


def content(node: dict[str, Any], mode: int) -> bytes:
    data = CORNERS.tobytes() + NORMALS.tobytes() + np.arange(3, dtype="<f4").tobytes()
    places = [(0, 36), (36, 36), (72, 12)]
    part = {"attributes": {"POSITION": 0, "NORMAL": 1, "_TIME": 2}, "mode": mode}
    document = scene_of(node) | {
        "meshes": [{"primitives": [part]}],
        "accessors": [
            {"bufferView": i, "componentType": 5126, "count": 3, "type": kind}
            for i, kind in enumerate(("VEC3", "VEC3", "SCALAR"))
        ],
        "bufferViews": [{"buffer": 0, "byteOffset": a, "byteLength": b} for a, b in places],
        "buffers": [{"byteLength": len(data)}],
    }
    return glb_file(document, data)


def normals_of(tmp_path: Path, node: dict[str, Any], mode: int) -> np.ndarray:
    cloud = read_points(write_file(tmp_path, content(node, mode)), attributes=True)
    assert not cloud.warnings
    assert len(cloud.points) == 3
    assert (cloud.faces is None) == (mode not in (4, 5))
    np.testing.assert_array_equal(cloud.attributes["TIME"], np.arange(3))
    return np.stack([cloud.attributes[name] for name in ("nx", "ny", "nz")], axis=1)


@pytest.mark.parametrize("mode", range(6))
def test_normals_turn_with_the_nodes(tmp_path: Path, mode: int) -> None:
    np.testing.assert_array_equal(normals_of(tmp_path, {}, mode), NORMALS)
    np.testing.assert_array_equal(normals_of(tmp_path, {"translation": [9, 9, 9]}, mode), NORMALS)
    turned = np.stack([-NORMALS[:, 1], NORMALS[:, 0], NORMALS[:, 2]], axis=1)
    node = {"rotation": QUARTER, "scale": [7, 7, 7]}
    np.testing.assert_allclose(normals_of(tmp_path, node, mode), turned, atol=1e-6)


@pytest.mark.parametrize("mode", [0, 4])
def test_normals_stay_normal_to_a_stretched_and_a_mirrored_surface(
    tmp_path: Path, mode: int
) -> None:
    for scale in ([1, 1, 4], [-1, 1, 1]):
        expected = NORMALS / np.array(scale)
        expected /= np.linalg.norm(expected, axis=1, keepdims=True)
        found = normals_of(tmp_path, {"scale": scale}, mode)
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_fans_are_named(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedFileError, match="fan of triangles"):
        read_points(write_file(tmp_path, content({}, 6)))


def test_a_surface_without_extent_has_no_normals(tmp_path: Path) -> None:
    np.testing.assert_array_equal(normals_of(tmp_path, {"scale": [0, 0, 0]}, 4), np.zeros((3, 3)))


def test_what_glb_of_points_holds_is_read_again(tmp_path: Path) -> None:
    cloud = replace(rich_cloud(), faces=None)
    write_cloud(tmp_path / "a.glb", "glb", cloud)
    found = read_points(tmp_path / "a.glb", attributes=True)
    names = set(cloud.attributes) - {"X"} | {"attribute_X"}
    assert set(found.attributes) == names
    assert not found.warnings
