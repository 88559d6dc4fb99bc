"""Formats of other programs: COLMAP, VTK, Gaussian splats, rows of float32."""

from __future__ import annotations

import gzip
import struct
from pathlib import Path

import numpy as np
import pytest

from service.formats import CloudFileError, MalformedFileError, read_points, sniff
from tests.factories.cloud_files import POINTS, npy, npz, ply
from tests.factories.decoding import write_file
from tests.factories.scanner_files import colmap, lvx2, obj, rows_of, splat, spz, vtk, vtp

FORMS = ("ascii", "binary", "appended", "raw")
FILES = {
    "colmap": colmap(),
    "splat": splat(),
    "spz": spz(),
    "spz in gzip": gzip.compress(spz(), mtime=0),
    "lvx2": lvx2(),
    "vtk": vtk(),
    "vtk binary": vtk(binary=True),
    "vtk CR LF": vtk().replace(b"\n", b"\r\n"),
    **{f"vtp {form}": vtp(form) for form in FORMS},
    **{f"vtp {form} zlib": vtp(form, compressed=True) for form in FORMS[1:]},
}


@pytest.mark.parametrize("name", FILES)
def test_points_are_read(tmp_path: Path, name: str) -> None:
    assert sniff(FILES[name]) == ("gzip" if "gzip" in name else name.split()[0])
    cloud = read_points(write_file(tmp_path, FILES[name]), attributes=True)
    tolerance = {"spz": 2e-4, "lvx2": 6e-4}.get(name.split()[0], 0)
    np.testing.assert_allclose(cloud.points, POINTS, rtol=0, atol=tolerance)
    assert cloud.format == name.split()[0]


@pytest.mark.parametrize("name", FILES)
def test_cut_files_are_errors(tmp_path: Path, name: str) -> None:
    for length in (len(FILES[name]) // 2 - 3, len(FILES[name]) // 4 - 3):
        with pytest.raises(CloudFileError):
            read_points(write_file(tmp_path, FILES[name][:length]))


@pytest.mark.parametrize("columns", range(3, 9))
def test_rows_of_declared_columns(tmp_path: Path, columns: int) -> None:
    path = write_file(tmp_path, rows_of(columns))
    for format in (None, "kitti"):
        cloud = read_points(path, format=format, columns=columns, attributes=True)
        np.testing.assert_array_equal(cloud.points, POINTS)
        assert len(cloud.attributes) == columns - 3
    with pytest.raises(MalformedFileError, match="columns"):
        read_points(write_file(tmp_path, rows_of(columns)[:-4]), columns=columns)
    with pytest.raises(MalformedFileError, match="columns is set"):
        read_points(write_file(tmp_path, ply()), columns=columns)


def test_rows_that_are_no_coordinates_are_refused(tmp_path: Path) -> None:
    content = np.random.default_rng(0).bytes(4 * 6 * 200)
    with pytest.raises(MalformedFileError, match="number of columns"):
        read_points(write_file(tmp_path, content), columns=6)


def test_attributes_of_points_from_pictures(tmp_path: Path) -> None:
    kept = read_points(write_file(tmp_path, colmap()), attributes=True).attributes
    assert kept["red"].tolist() == [9] * 40
    assert kept["point_id"].tolist() == list(range(7, 47))
    assert kept["track_length"].tolist() == [2 + i % 3 for i in range(40)]


def test_splats_are_named(tmp_path: Path) -> None:
    cloud = read_points(write_file(tmp_path, splat()), attributes=True)
    assert "splats" in cloud.warnings[0]
    np.testing.assert_allclose(np.exp(cloud.attributes["scale_1"]), 0.2, rtol=1e-6)


def test_data_sets_without_points_are_refused_by_name(tmp_path: Path) -> None:
    content = vtk().replace(b"POLYDATA", b"STRUCTURED_POINTS")
    with pytest.raises(CloudFileError, match="STRUCTURED_POINTS"):
        read_points(write_file(tmp_path, content))
    content = vtp().replace(b"PolyData", b"ImageData")
    with pytest.raises(CloudFileError, match="ImageData"):
        read_points(write_file(tmp_path, content))
    content = vtp().replace(b"<VTKFile", b"<!DOCTYPE a><VTKFile")
    with pytest.raises(CloudFileError, match="document type"):
        read_points(write_file(tmp_path, content))


def test_meshes_and_files_without_points_are_refused_or_empty(tmp_path: Path) -> None:
    for content in (b"solid a\nfacet\nendsolid a\n", colmap()[:8].replace(b"(", b"\0") + bytes(60)):
        with pytest.raises(CloudFileError):
            read_points(write_file(tmp_path, content), attributes=True)
    none = vtk().replace(b"POINTS 40 ", b"POINTS 0 ")
    assert read_points(write_file(tmp_path, none)).points.shape == (0, 3)
    long = struct.pack("<Q", 2) + colmap()[8:51] + b"\xff" * 8 + bytes(200)
    with pytest.raises(CloudFileError):
        read_points(write_file(tmp_path, long), format="colmap")


def test_announced_counts_are_checked(tmp_path: Path) -> None:
    huge = struct.pack("<Q", 1 << 40)
    for content in (huge + colmap()[8:], vtk().replace(b"POINTS 40 ", b"POINTS 99999999999 ")):
        with pytest.raises(CloudFileError):
            read_points(write_file(tmp_path, content))


def text_ply(element: str = "vertex", axes: str = "xyz", eol: str = "\n", stray: str = "") -> bytes:
    lines = ["ply", "format ascii 1.0", *([stray] if stray else []), f"element {element} 40"]
    lines += [f"property float {axis}" for axis in axes] + ["element face 1"]
    lines += ["property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(f"{value:.9g}" for value in point) for point in POINTS]
    return eol.join([*lines, *rows, "3 0 1 2", ""]).encode()


ODD = {
    "PLY, CR": text_ply(eol="\r"),
    "PLY, byte order mark": b"\xef\xbb\xbf" + text_ply(),
    "PLY, a line without 'comment'": text_ply(stray="Made by hand"),
    "PLY, element point": text_ply("point"),
    "PLY, capitals": text_ply(axes="XYZ"),
    "PLY, UTF-16": text_ply().decode().encode("utf-16"),
    "OBJ, indented, CR": obj().replace(b"\nv ", b"\n  v ").replace(b"\n", b"\r"),
    "OBJ, a long comment": b"# " + b"x" * 5000 + b"\n" + obj(),
    "NPZ, coords": npz(coords=POINTS, labels=np.arange(40)),
    "NPY, rows of fields": npy(
        np.array([tuple(p) for p in POINTS.tolist()], [(a, "f4") for a in "xyz"]).reshape(8, 5)
    ),
}


@pytest.mark.parametrize("name", ODD)
def test_odd_but_clear_files_are_read(tmp_path: Path, name: str) -> None:
    cloud = read_points(write_file(tmp_path, ODD[name]), attributes=True)
    np.testing.assert_allclose(cloud.points, POINTS, rtol=1e-6)
    assert cloud.format == name[:3].lower()
    assert (cloud.faces is not None) == (name[0] in "PO")


def test_arrays_of_three_rows_are_turned(tmp_path: Path) -> None:
    many = np.tile(POINTS, (3, 1))
    cloud = read_points(write_file(tmp_path, npy(many.T)))
    np.testing.assert_array_equal(cloud.points, many)
    assert "transpose" in cloud.warnings[0]
