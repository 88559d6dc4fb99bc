"""Meshes: their vertices, and samples of their surface."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import CloudFileError, FileLimitError, ReadLimits, read_points
from tests.factories.decoding import write_file
from tests.factories.scanner_files import DOUBLES, glb, obj, off, stl_binary

REAL = [
    ("formats/mesh.obj", 5623, (8.902039, 14.477572, 22.889115)),
    ("blade/nasa_blade.stl", 7120, (0.0556573, 0.0405973, 0.02)),
]


@pytest.mark.real_data
@pytest.mark.parametrize(("name", "count", "extent"), REAL)
def test_files_of_real_tools(
    data: Path, name: str, count: int, extent: tuple[float, float, float]
) -> None:
    points = read_points(data / name).points
    assert points.shape == (count, 3)
    np.testing.assert_allclose(np.ptp(points, axis=0), extent, rtol=1e-5)


@pytest.mark.parametrize(
    "content", [stl_binary(), obj(), off(), glb()], ids=["stl", "obj", "off", "glb"]
)
def test_surface_samples_lie_on_the_triangles(tmp_path: Path, content: bytes) -> None:
    path = write_file(tmp_path, content)
    cloud = read_points(path, surface_samples=5000)
    assert cloud.points.shape == (5000, 3)
    assert cloud.normals is not None
    np.testing.assert_array_equal(cloud.points, read_points(path, surface_samples=5000).points)
    triangles = DOUBLES[:39].reshape(13, 3, 3)
    if not content.startswith(b"made by hand"):
        triangles = np.stack([DOUBLES[i : i + 3] for i in range(38)])
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    normals /= 2 * areas[:, None]
    heights = np.abs(np.einsum("td,ntd->nt", normals, cloud.points[:, None] - triangles[:, 0]))
    assert heights.min(axis=1).max() < 1e-4
    # area-weighted: the mean of the samples is that of the surface, to three standard errors
    centre = (areas / areas.sum()) @ triangles.mean(axis=1)
    error = cloud.points.std(axis=0) / np.sqrt(5000)
    assert (np.abs(cloud.points.mean(axis=0) - centre) < 4 * error).all()


def test_samples_are_limited(tmp_path: Path) -> None:
    with pytest.raises(FileLimitError):
        read_points(write_file(tmp_path, obj()), ReadLimits(max_points=100), surface_samples=101)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (glb(accessors=[{"componentType": 5126, "count": 10**9, "type": "VEC3"}]), "sparse"),
        (glb(buffers=[{"byteLength": 9, "uri": "file:///etc/passwd"}]), "other files"),
        (glb(buffers=[{"byteLength": 9, "uri": "http://127.0.0.1/x"}]), "other files"),
        (glb(nodes=[{"mesh": 0, "children": [1, 1]}, {"mesh": 0}]), "two parents"),
        (glb(nodes=[{"mesh": 0}] * 9 + [{"mesh": -9}]), "not valid"),
        (glb(nodes=[{"mesh": 0}] * 200_000), "too many"),
    ],
)
def test_refused(tmp_path: Path, content: bytes, words: str) -> None:
    path = write_file(tmp_path, content)
    with pytest.raises(CloudFileError, match=words):
        read_points(path)
