"""Laws of all readers: the file's points, or an error that says why."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import (
    CloudFileError,
    DecodedCloud,
    MalformedFileError,
    MissingAttributeError,
    ReadLimits,
    UnknownFormatError,
    read_points,
    read_surface,
    sniff,
)
from tests.factories.cloud_files import NORMALS, POINTS, npy, npz, pcd, ply, seeds, text_rows
from tests.factories.decoding import decode, decode_frugally, write_file
from tests.factories.hostile_files import ALL, HUGE, LIES, damaged
from tests.factories.scanner_files import scanner_seeds

REAL = [
    ("csv_header.csv", "xyz", 7999, (80.2649, 70.450547, 24.4703)),
    ("pcd_ascii_normals.pcd", "pcd", 397, (0.1535, 0.14708, 0.112829)),
    ("pcd_binary_compressed_rgba.pcd", "pcd", 13704, (0.15389, 0.252051, 0.177)),
    ("pcd_binary_rgb.pcd", "pcd", 46380, (49.508, 40.339905, 17.22133)),
    ("pcd_binary_xyz_not_first.pcd", "pcd", 10007, (1805.0621, 1306.2616, 20001.0)),
    ("ply_ascii_range_grid.ply", "ply", 14879, (0.0936924, 0.1446016, 0.1492462)),
    ("xyz_text_mm.txt", "xyz", 20000, (261.730003, 38.721138, 72.638733)),
]


@pytest.mark.real_data
@pytest.mark.parametrize(("name", "format", "count", "extent"), REAL)
def test_files_of_real_tools(
    data: Path, name: str, format: str, count: int, extent: tuple[float, float, float]
) -> None:
    cloud = read_points(data / "formats" / name)
    assert (cloud.format, cloud.points.shape) == (format, (count, 3))
    np.testing.assert_allclose(np.ptp(cloud.points, axis=0), extent, rtol=1e-5)


@pytest.mark.real_data
def test_every_benchmark_cloud_is_read(data: Path) -> None:
    files = [path for path in data.rglob("*.ply") if path.parent.name != "formats"]
    assert len(files) > 50
    for path in files:
        points = read_points(path).points
        assert len(points) * 12 <= path.stat().st_size
        assert np.isfinite(points).any(axis=0).all(), path


@pytest.mark.parametrize("kind", seeds())
def test_points_are_those_of_the_file(tmp_path: Path, kind: str) -> None:
    content = seeds()[kind]
    cloud = decode(tmp_path, content)
    np.testing.assert_array_equal(cloud.points.astype(np.float32), POINTS)
    assert sniff(content[:4096]) == {"npz": "zip"}.get(cloud.format, cloud.format)
    assert cloud.points.dtype.isnative
    if cloud.format in ("ply", "pcd", "npz"):
        assert cloud.normals is not None
        np.testing.assert_array_equal(cloud.normals, NORMALS)


@pytest.mark.parametrize("kind", scanner_seeds())
def test_points_are_those_of_the_scanner_file(tmp_path: Path, kind: str) -> None:
    content = scanner_seeds()[kind]
    points = read_points(write_file(tmp_path, content)).points
    shift = [500_000.0, 4_000_000, 0] if kind.startswith("la") else [0, 0, 0]
    expected = POINTS[:39] if kind.startswith("stl") else POINTS
    tolerance = {"spz": 2e-4, "lvx2": 6e-4}.get(kind, 2e-5)
    np.testing.assert_allclose(points, expected.astype(float) + shift, rtol=0, atol=tolerance)
    assert sniff(content[:4096]) is not None


@pytest.mark.parametrize(
    "content", [b"", b"\n\n", b"hello\n", b"\x00" * 99, b"GIF89a", b"<html>\n"]
)
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(CloudFileError):
        decode(tmp_path, content)


def test_unknown_content_is_named(tmp_path: Path) -> None:
    with pytest.raises(UnknownFormatError, match="GIF89a"):
        decode(tmp_path, b"GIF89a" + bytes(99))


def test_choices_need_their_format(tmp_path: Path) -> None:
    path = write_file(tmp_path, ply())
    with pytest.raises(MalformedFileError, match="scan is set"):
        read_points(path, scan=0)
    with pytest.raises(MalformedFileError, match="no faces"):
        read_surface(path, surface_samples=10)


WEIGHTS = np.linspace(0, 1, len(POINTS)).astype(np.float32)
RECORDS = np.rec.fromarrays([*POINTS.T, WEIGHTS], names="x,y,z,weight")
WEIGHTED = {
    "ply": (ply(), "red", np.arange(40)),
    "pcd": (pcd(), "normal_x", NORMALS[:, 0]),
    "csv": (
        b'x,y,z,class,"weight"\n'
        + b"".join(
            row + b",tree,%.9g\n" % weight
            for row, weight in zip(text_rows(POINTS, ",").splitlines(), WEIGHTS, strict=True)
        ),
        "weight",
        WEIGHTS,
    ),
    "npy": (npy(RECORDS), "weight", WEIGHTS),
    "npz": (npz(points=POINTS, weight=WEIGHTS), "weight", WEIGHTS),
    "npz of records": (npz(cloud=RECORDS), "weight", WEIGHTS),
}


@pytest.mark.parametrize("kind", WEIGHTED)
def test_weights_are_the_attribute_of_that_name(tmp_path: Path, kind: str) -> None:
    content, name, expected = WEIGHTED[kind]
    path = tmp_path / "cloud"
    path.write_bytes(content)
    cloud = read_points(path, weights=name)
    assert cloud.weights is not None
    np.testing.assert_array_equal(cloud.weights.astype(np.float32), expected)
    np.testing.assert_array_equal(cloud.points.astype(np.float32), POINTS)
    assert cloud.attributes == {}
    assert cloud.warnings == ()
    with pytest.raises(MissingAttributeError, match=f"'class'.* this file: .*'{name}'"):
        read_points(path, weights="class")


def test_weights_where_no_column_has_a_name(tmp_path: Path) -> None:
    for content in (text_rows(POINTS), npy(POINTS)):
        (tmp_path / "cloud").write_bytes(content)
        with pytest.raises(MissingAttributeError, match="this file: none"):
            read_points(tmp_path / "cloud", weights="weight")


@pytest.mark.parametrize("kind", seeds())
def test_a_cut_file_is_an_error_or_gives_its_points(tmp_path: Path, kind: str) -> None:
    """A text without a count cannot know: it gives the whole rows before the cut and says so."""
    content = seeds()[kind]
    step = max(1, len(content) // 150)
    for size in [*range(0, len(content), step), *range(len(content) - 20, len(content))]:
        found = decode_frugally(tmp_path, content[:size])
        if isinstance(found, CloudFileError):
            assert str(found)
            continue
        points = found.points.astype(np.float32)
        if kind in ("xyz", "csv"):
            whole = len(points) - any("may have been cut" in w for w in found.warnings)
            np.testing.assert_array_equal(points[:whole], POINTS[:whole])
        elif any("may have been cut" in warning for warning in found.warnings):
            np.testing.assert_array_equal(points[:-1], POINTS[:-1])
        else:
            np.testing.assert_array_equal(points, POINTS)


def test_every_damaged_file_is_an_error_or_points(tmp_path: Path) -> None:
    names = set()
    for name, content in damaged():
        found = decode_frugally(tmp_path, content)
        names.add(name)
        if isinstance(found, DecodedCloud):
            assert found.points.shape[1:] == (3,), name
            assert found.points.dtype in (np.float32, np.float64), name
            assert len(found.points) <= max(len(content), 40), name
    assert len(names) >= 2000


@pytest.mark.parametrize("kind", scanner_seeds())
def test_a_cut_scanner_file_is_an_error_or_gives_its_points(tmp_path: Path, kind: str) -> None:
    """What stands behind the points (faces, ends of solids) may be cut; bare rows cannot know."""
    content = ALL[kind]
    whole = decode_frugally(tmp_path, content)
    assert isinstance(whole, DecodedCloud)
    for size in np.unique(np.linspace(0, len(content) - 1, 120).astype(int)):
        found = decode_frugally(tmp_path, content[:size])
        if isinstance(found, DecodedCloud):
            count = len(found.points)
            assert count == len(whole.points) or kind in ("obj", "splat"), size
            np.testing.assert_array_equal(found.points[:-1], whole.points[: count - 1])


@pytest.mark.parametrize("case", LIES)
def test_lies_are_errors(tmp_path: Path, case: str) -> None:
    found = decode_frugally(tmp_path, LIES[case])
    assert isinstance(found, CloudFileError), found
    assert str(found)


@pytest.mark.parametrize("case", HUGE)
def test_sizes_of_headers_and_lines_are_bounded(tmp_path: Path, case: str) -> None:
    assert isinstance(decode_frugally(tmp_path, HUGE[case]), CloudFileError)


def test_the_limit_on_points_is_kept(tmp_path: Path) -> None:
    """A file with more points is thinned, or refused."""
    path = tmp_path / "cloud"
    for content in seeds().values():
        path.write_bytes(content)
        try:
            cloud = read_points(path, ReadLimits(max_points=2))
        except CloudFileError as error:
            assert "limit" in str(error) or "memory" in str(error)  # noqa: PT017
            continue
        assert len(cloud.points) <= 16
        assert cloud.rows is not None


FINDINGS = Path(__file__).parent / "findings"


@pytest.mark.parametrize("name", sorted(path.name for path in FINDINGS.iterdir()))
def test_what_fuzzing_found(tmp_path: Path, name: str) -> None:
    content = (FINDINGS / name).read_bytes()
    assert isinstance(decode_frugally(tmp_path, content), CloudFileError)
