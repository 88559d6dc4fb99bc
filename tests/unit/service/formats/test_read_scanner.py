"""LAS, LAZ, E57, meshes, PTX, KITTI and wrapped files give the points that they hold."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from service.formats import (
    FORMATS,
    CloudFileError,
    FileLimitError,
    Limits,
    MalformedFileError,
    UnknownFormatError,
    UnsupportedFileError,
    read_points,
    sniff,
)
from tests.factories.cloud_files import POINTS, npz, ply, text_rows
from tests.factories.scanner_files import (
    DOUBLES,
    e57,
    glb,
    kitti,
    las,
    obj,
    off,
    ptx,
    scanner_seeds,
    stl_binary,
    zipped,
)

REAL = [
    ("formats/1.2-with-color.las", 1065, (3362.7, 4635.73, 179.79)),
    ("formats/autzen-thin.las", 10653, (3405.74, 4648.98, 187.14)),
    ("formats/mesh.obj", 5623, (8.902039, 14.477572, 22.889115)),
    ("blade/nasa_blade.stl", 7120, (0.0556573, 0.0405973, 0.02)),
]


def write(tmp_path: Path, content: bytes) -> Path:
    path = tmp_path / "cloud"
    path.write_bytes(content)
    return path


@pytest.mark.real_data
@pytest.mark.parametrize(("name", "count", "extent"), REAL)
def test_files_of_real_tools(
    data: Path, name: str, count: int, extent: tuple[float, float, float]
) -> None:
    points = read_points(data / name).points
    assert points.shape == (count, 3)
    np.testing.assert_allclose(np.ptp(points, axis=0), extent, rtol=1e-5)


@pytest.mark.real_data
def test_kitti_rows_are_read_if_declared(data: Path) -> None:
    path = data / "formats/kitti_velodyne.bin"
    with pytest.raises(UnknownFormatError):
        read_points(path)
    points = read_points(path, format="kitti").points
    assert points.shape == (20_000, 3)
    distance = np.linalg.norm(points, axis=1)
    assert 1 < distance.min() < distance.max() < 130  # the range of the Velodyne HDL-64E, metres


@pytest.mark.parametrize("kind", scanner_seeds())
def test_points_are_those_of_the_file(tmp_path: Path, kind: str) -> None:
    content = scanner_seeds()[kind]
    points = read_points(write(tmp_path, content)).points
    shift = [500_000.0, 4_000_000, 0] if "la" in kind.split()[0] else [0, 0, 0]
    expected = POINTS[:39] if kind.startswith("stl") else POINTS
    np.testing.assert_allclose(points, expected.astype(float) + shift, rtol=0, atol=2e-5)
    assert sniff(content[:4096]) is not None


def test_every_format_has_a_case() -> None:
    from tests.factories.cloud_files import seeds

    met = {sniff(content[:4096]) for content in {**seeds(), **scanner_seeds()}.values()}
    assert met | {"kitti"} == {format.name for format in FORMATS}


def test_kitti(tmp_path: Path) -> None:
    np.testing.assert_array_equal(
        read_points(write(tmp_path, kitti()), format="kitti").points, POINTS
    )
    with pytest.raises(MalformedFileError, match="639 bytes"):
        read_points(write(tmp_path, kitti()[:-1]), format="kitti")


@pytest.mark.parametrize("make", [e57, ptx], ids=["e57", "ptx"])
def test_scans_are_merged_or_picked(tmp_path: Path, make: object) -> None:
    assert callable(make)
    path = write(tmp_path, make(scans=2))
    merged = read_points(path)
    np.testing.assert_allclose(merged.points, DOUBLES, atol=2e-5)
    assert "2 scans are merged" in merged.warnings[0]
    second = read_points(path, scan=1)
    np.testing.assert_allclose(second.points, DOUBLES[20:], atol=2e-5)
    assert second.warnings == ()
    for scan in (-1, 2):
        with pytest.raises(MalformedFileError, match="the file has 2"):
            read_points(path, scan=scan)


def test_missing_returns_of_ptx_are_nan(tmp_path: Path) -> None:
    lines = ptx().splitlines()
    lines[12] = b"0 0 0 0.5"
    points = read_points(write(tmp_path, b"\n".join(lines) + b"\n")).points
    assert np.isnan(points[2]).all()
    np.testing.assert_allclose(np.delete(points, 2, 0), np.delete(DOUBLES, 2, 0), atol=2e-5)


@pytest.mark.parametrize(
    "content", [stl_binary(), obj(), off(), glb()], ids=["stl", "obj", "off", "glb"]
)
def test_surface_samples_lie_on_the_triangles(tmp_path: Path, content: bytes) -> None:
    path = write(tmp_path, content)
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


def test_choices_need_their_format(tmp_path: Path) -> None:
    path = write(tmp_path, ply())
    with pytest.raises(MalformedFileError, match="scan is chosen"):
        read_points(path, scan=0)
    with pytest.raises(MalformedFileError, match="surface_samples is chosen"):
        read_points(path, surface_samples=10)
    with pytest.raises(FileLimitError):
        read_points(write(tmp_path, obj()), Limits(max_points=100), surface_samples=101)


def test_a_declared_format_is_held_to(tmp_path: Path) -> None:
    for format in FORMATS:
        if format.name not in ("ply", "kitti"):
            with pytest.raises(CloudFileError):
                read_points(write(tmp_path, ply()), format=format.name)
    with pytest.raises(UnknownFormatError, match="no format is called 'docx'"):
        read_points(write(tmp_path, ply()), format="docx")


def test_wrapped_files(tmp_path: Path) -> None:
    for content in (gzip.compress(text_rows(POINTS)), zipped(las(compressed=True)), zipped(obj())):
        assert len(read_points(write(tmp_path, content)).points) == 40
    assert len(read_points(write(tmp_path, zipped(e57(scans=2))), scan=0).points) == 20
    assert list(tmp_path.iterdir()) == [tmp_path / "cloud"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (zipped(zipped(ply())), "archive within"),
        (gzip.compress(gzip.compress(ply())), "archive within"),
        (glb(accessors=[{"componentType": 5126, "count": 10**9, "type": "VEC3"}]), "sparse"),
        (glb(buffers=[{"byteLength": 9, "uri": "file:///etc/passwd"}]), "other files"),
        (glb(buffers=[{"byteLength": 9, "uri": "http://127.0.0.1/x"}]), "other files"),
        (glb(nodes=[{"mesh": 0, "children": [1, 1]}, {"mesh": 0}]), "two parents"),
        (glb(nodes=[{"mesh": 0}] * 9 + [{"mesh": -9}]), "not in order"),
        (glb(nodes=[{"mesh": 0}] * 200_000), "too many"),
        (zipped(b""), "empty"),
    ],
)
def test_refused(tmp_path: Path, content: bytes, words: str) -> None:
    path = write(tmp_path, content)
    with pytest.raises(CloudFileError, match=words):
        read_points(path)


def test_npz_within_gzip(tmp_path: Path) -> None:
    path = write(tmp_path, gzip.compress(npz(points=POINTS)))
    np.testing.assert_array_equal(read_points(path).points, POINTS)


def test_two_files_in_a_zip_are_not_clear(tmp_path: Path) -> None:
    import io
    import zipfile

    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a.ply", ply())
        archive.writestr("b.ply", ply())
    with pytest.raises(UnsupportedFileError, match="2 files"):
        read_points(write(tmp_path, file.getvalue()))
