"""Every kind of file gives the points that it holds, whatever its dialect and its name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import (
    CloudFileError,
    DecodedCloud,
    MalformedFileError,
    MissingAttributeError,
    UnknownFormatError,
    read_points,
    sniff,
    write_ply,
)
from tests.factories.cloud_files import NORMALS, POINTS, npy, npz, pcd, ply, seeds, text_rows

REAL = [
    ("csv_header.csv", "xyz", 7999, (80.2649, 70.450547, 24.4703)),
    ("pcd_ascii_normals.pcd", "pcd", 397, (0.1535, 0.14708, 0.112829)),
    ("pcd_binary_compressed_rgba.pcd", "pcd", 13704, (0.15389, 0.252051, 0.177)),
    ("pcd_binary_rgb.pcd", "pcd", 46380, (49.508, 40.339905, 17.22133)),
    ("pcd_binary_xyz_not_first.pcd", "pcd", 10007, (1805.0621, 1306.2616, 20001.0)),
    ("ply_ascii_range_grid.ply", "ply", 14879, (0.0936924, 0.1446016, 0.1492462)),
    ("xyz_text_mm.txt", "xyz", 20000, (261.730003, 38.721138, 72.638733)),
]


def decode(tmp_path: Path, content: bytes) -> DecodedCloud:
    path = tmp_path / "a file without a telling name"
    path.write_bytes(content)
    return read_points(path)


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


def test_double_precision_survives(tmp_path: Path) -> None:
    points = POINTS.astype(np.float64) + np.array([500_000.000123, 4_000_000.000456, 0])
    write_ply(tmp_path / "utm.ply", points)
    np.testing.assert_array_equal(read_points(tmp_path / "utm.ply").points, points)
    np.testing.assert_array_equal(decode(tmp_path, npy(points)).points, points)
    text = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist()).encode()
    np.testing.assert_array_equal(decode(tmp_path, text).points, points)


def test_written_ply_keeps_precision_and_points(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", POINTS)
    cloud = read_points(tmp_path / "a.ply")
    assert cloud.points.dtype == np.float32
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert cloud.warnings == ()


def test_pcd_viewpoint(tmp_path: Path) -> None:
    assert decode(tmp_path, pcd()).viewpoint == (1, 2, 3, 1, 0, 0, 0)


ROWS = {",": text_rows(POINTS, ","), ";": text_rows(POINTS, ";"), "\t": text_rows(POINTS, "\t")}
DIALECTS = {
    "comma": ROWS[","],
    "semicolon": ROWS[";"],
    "tab": ROWS["\t"],
    "decimal comma": ROWS[";"].replace(b".", b","),
    "decimal comma, header, tab": b"X\tY\tZ\n" + ROWS["\t"].replace(b".", b","),
    "blanks": text_rows(POINTS, "   "),
    "comma and blank": text_rows(POINTS, " , "),
    "CRLF": text_rows(POINTS, " ", "\r\n"),
    "trailing blanks": text_rows(POINTS, " ", "  \n"),
    "trailing delimiter": text_rows(POINTS, ",", ",\n"),
    "byte order mark": b"\xef\xbb\xbf" + text_rows(POINTS),
    "byte order mark and header": b"\xef\xbb\xbfX;Y;Z\n" + ROWS[";"],
    "header": b"x,y,z\n" + ROWS[","],
    "quoted header with units": b'"X [m]","Y [m]","Z [m]"\r\n' + ROWS[","],
    "comment header": b"//X Y Z\n" + text_rows(POINTS),
    "comments between": b"# a scan\n# of 40 points\n"
    + text_rows(POINTS).replace(b"\n", b"\n\n# next\n"),
    "count first": b"40\n" + text_rows(POINTS),
    "stray lines": b"Scan of a part\nunit: mm\n" + text_rows(POINTS),
    "three unnamed columns": b"a,b,c\n" + ROWS[","],
    "more columns": text_rows(np.hstack([POINTS, NORMALS])),
    "columns out of order": b"intensity,z,y,x\n"
    + text_rows(np.hstack([NORMALS[:, :1], POINTS[:, ::-1]]), ","),
    "text column": b"x,y,z,class\n" + text_rows(POINTS, ",", ",tree\n"),
    "no newline at the end": text_rows(POINTS)[:-1],
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_text_dialects(tmp_path: Path, dialect: str) -> None:
    cloud = decode(tmp_path, DIALECTS[dialect])
    np.testing.assert_array_equal(cloud.points.astype(np.float32), POINTS)


def test_named_normals_of_text(tmp_path: Path) -> None:
    rows = np.hstack([POINTS, NORMALS])
    cloud = decode(tmp_path, b"x y z nx ny nz\n" + text_rows(rows))
    assert cloud.normals is not None
    np.testing.assert_array_equal(cloud.normals.astype(np.float32), NORMALS)


def test_what_was_guessed_is_reported(tmp_path: Path) -> None:
    assert "line 1 to 2" in decode(tmp_path, DIALECTS["stray lines"]).warnings[0]
    assert "may have been cut" in decode(tmp_path, DIALECTS["no newline at the end"]).warnings[0]
    assert "columns after" in decode(tmp_path, npy(np.hstack([POINTS, NORMALS]))).warnings[0]
    assert "bytes after" in decode(tmp_path, ply() + b"more").warnings[0]
    assert "bytes after" in decode(tmp_path, pcd() + b"more").warnings[0]


def test_nan_rows_are_kept(tmp_path: Path) -> None:
    rows = text_rows(POINTS) + b"nan nan nan\nNaN NaN NaN\n"
    points = decode(tmp_path, rows).points
    assert np.isnan(points).all(axis=1).tolist() == [False] * 40 + [True] * 2


@pytest.mark.parametrize(
    "array",
    [
        POINTS.astype(">f8"),
        POINTS.astype(np.float16).astype(np.float64).astype(np.float16),
        np.asfortranarray(POINTS),
        POINTS.reshape(8, 5, 3),
        (POINTS * 1000).round().astype(np.int32),
        np.rec.fromarrays([*POINTS.T, NORMALS[:, 0]], names="x,y,z,intensity"),
    ],
    ids=["big endian", "half", "Fortran", "grid", "integers", "records"],
)
def test_numpy_arrays(tmp_path: Path, array: np.ndarray) -> None:
    expected = (
        np.stack([array[n] for n in "xyz"], axis=1) if array.dtype.names else array.reshape(-1, 3)
    )
    for content in (npy(array), npz(cloud=array)):
        points = decode(tmp_path, content).points
        assert points.dtype in (np.float32, np.float64)
        np.testing.assert_array_equal(points, expected)


UNCLEAR = {
    "which columns": (
        b"id,a,b,c\n" + text_rows(np.hstack([POINTS, NORMALS[:, :1]]), ","),
        "line 1",
    ),
    "a word among numbers": (text_rows(POINTS) + b"1 two 3\n", "line 41: 'two'"),
    "a short row": (text_rows(POINTS) + b"1 2\n" + text_rows(POINTS), "line 41: 2 fields"),
    "a word among decimal commas": (
        ROWS[";"].replace(b".", b",") + b"1,5;two;3,5\n",
        "line 41: 'two'",
    ),
    "an empty cell": (text_rows(POINTS, ",") + b"1,,3\n", "line 41: ''"),
    "a count above the rows": (b"41\n" + text_rows(POINTS), "40 rows, but 41"),
    "old Mac line ends": (text_rows(POINTS, " ", "\r"), "line 1"),
    "two vertex elements": (
        ply().replace(b"obj_info made by hand", b"element vertex 40"),
        "'vertex'",
    ),
    "no z": (ply().replace(b"float z", b"float w"), "'z'"),
    "unknown PLY keyword": (ply().replace(b"obj_info", b"objinfo"), "line 4: 'objinfo"),
    "a property twice": (ply().replace(b"float y", b"float x"), "line 7"),
    "PCD without x": (pcd().replace(b"_ x y", b"_ w y"), "FIELDS"),
    "PCD counts disagree": (pcd().replace(b"WIDTH 20", b"WIDTH 21"), "WIDTH x HEIGHT is 42"),
    "PCD types and sizes disagree": (pcd().replace(b"SIZE 4 ", b"SIZE "), "differ: 8, 7"),
    "complex numbers": (npy(POINTS.astype(np.complex64)), "complex64"),
    "two columns": (npy(POINTS[:, :2]), "(40, 2)"),
    "two unnamed arrays": (npz(a=POINTS, b=POINTS), "which are the points"),
    "normals of another cloud": (npz(points=POINTS, normals=NORMALS[:9]), "9 normals"),
}


@pytest.mark.parametrize("case", UNCLEAR)
def test_what_is_not_clear_is_an_error_that_names_the_place(tmp_path: Path, case: str) -> None:
    content, words = UNCLEAR[case]
    with pytest.raises(MalformedFileError) as caught:
        decode(tmp_path, content)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    "content", [b"", b"\n\n", b"hello\n", b"\x00" * 99, b"GIF89a", b"<html>\n"]
)
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(CloudFileError):
        decode(tmp_path, content)


def test_unknown_content_is_named(tmp_path: Path) -> None:
    with pytest.raises(UnknownFormatError, match="GIF89a"):
        decode(tmp_path, b"GIF89a" + bytes(99))


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
    with pytest.raises(MissingAttributeError, match=f"'class'.* there are .*'{name}'"):
        read_points(path, weights="class")


def test_weights_where_no_column_has_a_name(tmp_path: Path) -> None:
    for content in (text_rows(POINTS), npy(POINTS)):
        (tmp_path / "cloud").write_bytes(content)
        with pytest.raises(MissingAttributeError, match="there are none"):
            read_points(tmp_path / "cloud", weights="weight")
