"""Draco: alone and within glTF, as the same points without it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from service.formats import CloudFileError, DecodedCloud, read_points
from tests.factories.gltf import glb_file

SHAPE: Any = trimesh.creation.icosphere(subdivisions=2)
VERTICES = np.asarray(SHAPE.vertices, np.float32) * [1, 2, 3]
FACES = np.asarray(SHAPE.faces, np.uint32)


def mesh() -> bytes:
    return bytes(DracoPy.encode(VERTICES, FACES, quantization_bits=0))


def cloud() -> bytes:
    return bytes(DracoPy.encode(VERTICES, quantization_bits=0))


def gltf(data: bytes, *, binary: bool) -> bytes:
    """A scene of one part, compressed by Draco."""
    part = {
        "attributes": {"POSITION": 0},
        "indices": 1,
        "extensions": {
            "KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}
        },
    }
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "extensionsRequired": ["KHR_draco_mesh_compression"],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
        "accessors": [
            {"componentType": 5126, "count": len(VERTICES), "type": "VEC3"},
            {"componentType": 5125, "count": FACES.size, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [part]}],
        "nodes": [{"mesh": 0, "translation": [1, 0, 0]}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    if not binary:
        import base64

        uri = base64.b64encode(data).decode()
        document["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{uri}"
        return json.dumps(document).encode()
    return glb_file(document, data + bytes(-len(data) % 4))


def read(folder: Path, content: bytes, **choices: Any) -> DecodedCloud:
    (folder / "cloud").write_bytes(content)
    return read_points(folder / "cloud", **choices)


def assert_same_places(found: NDArray[Any], expected: NDArray[Any]) -> None:
    """Draco orders points as it likes."""
    first, second = (np.unique(rows.round(4), axis=0) for rows in (found, expected))
    np.testing.assert_allclose(first, second, atol=1e-3)


@pytest.mark.parametrize("make", [mesh, cloud])
def test_points_and_faces(tmp_path: Path, make: Any) -> None:
    found = read(tmp_path, make(), attributes=True)
    assert found.format == "draco"
    assert_same_places(found.points, VERTICES)
    if make is mesh:
        assert found.faces is not None
        area = trimesh.Trimesh(found.points, found.faces, process=False).area
        assert area == pytest.approx(trimesh.Trimesh(VERTICES, FACES, process=False).area)


@pytest.mark.parametrize("binary", [True, False])
def test_within_gltf(tmp_path: Path, *, binary: bool) -> None:
    found = read(tmp_path, gltf(mesh(), binary=binary), attributes=True)
    assert found.format == "gltf"
    assert_same_places(found.points, VERTICES + np.array([1, 0, 0]))
    assert found.faces is not None
    assert len(found.faces) == len(FACES)


@pytest.mark.parametrize("make", [mesh, cloud, lambda: gltf(mesh(), binary=True)])
def test_damage_is_an_error(tmp_path: Path, make: Any) -> None:
    content = make()
    rng = np.random.default_rng(0)
    for _ in range(60):
        damaged = bytearray(content[: int(rng.integers(20, len(content) + 1))])
        for place in rng.integers(5, len(damaged), 4):
            damaged[place] = int(rng.integers(256))
        try:
            assert read(tmp_path, bytes(damaged)).points.shape[1] == 3
        except CloudFileError:
            continue
