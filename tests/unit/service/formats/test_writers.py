"""What is written is read back, by this package and by others; what is lost is named."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from service.formats import (
    WRITERS,
    DecodedCloud,
    LasMetadata,
    LasRecord,
    UnsupportedFileError,
    read_crs,
    read_points,
    write_cloud,
    write_pieces,
    write_ply,
)
from service.formats.colors import find_colors
from service.formats.column_names import find_normals
from tests.factories.cloud_files import POINTS
from tests.factories.rich_clouds import COUNT, rich_cloud

FULL = ("ply", "pcd", "las", "laz", "e57", "npy", "xyz", "csv")
MESHES = ("ply", "obj", "stl", "glb")
SCALARS = ("intensity", "classification", "return_number", "gps_time", "roughness", "attribute_X")


def written(path: Path, format: str, cloud: DecodedCloud) -> tuple[DecodedCloud, tuple[str, ...]]:
    """Return what is read from a written file, and the warnings of the writer."""
    file = path / f"a.{format}"
    warnings = write_cloud(file, format, cloud)
    return read_points(file, attributes=True), warnings


def unit_normals(cloud: DecodedCloud) -> NDArray[np.float64]:
    names = list(cloud.attributes)
    places = find_normals(names)
    if places is None:
        assert cloud.normals is not None
        return cloud.normals.astype(float)
    return np.stack([cloud.attributes[names[i]] for i in places], axis=1).astype(float)


def colors_of(cloud: DecodedCloud) -> NDArray[np.uint8]:
    attributes = dict(cloud.attributes)
    if "rgb" in attributes:
        bits = attributes["rgb"].view(np.uint32)
        return np.stack([bits >> shift & 255 for shift in (16, 8, 0)], axis=1).astype(np.uint8)
    colors = find_colors(attributes)
    assert colors is not None
    return colors.to_8_bits()


def assert_same(found: DecodedCloud, cloud: DecodedCloud) -> None:
    np.testing.assert_allclose(found.points, cloud.points, rtol=0, atol=6e-4)
    np.testing.assert_allclose(unit_normals(found), unit_normals(cloud), atol=1e-6)
    np.testing.assert_array_equal(colors_of(found), colors_of(cloud))
    for name in SCALARS:
        expected = cloud.attributes[name.removeprefix("attribute_")]
        column = found.attributes[name].astype(expected.dtype)
        np.testing.assert_array_equal(column, expected, err_msg=name)


@pytest.mark.parametrize(("first", "second"), [*product(FULL, FULL)])
def test_attributes_survive_every_pair_of_formats(tmp_path: Path, first: str, second: str) -> None:
    cloud = replace(rich_cloud(), faces=None)
    once, warnings = written(tmp_path, first, cloud)
    assert [text for text in warnings if "'X'" not in text and "float64" not in text] == []
    assert_same(once, cloud)
    twice, warnings = written(tmp_path, second, once)
    assert [text for text in warnings if "float64" not in text] == []
    assert_same(twice, cloud)


@pytest.mark.parametrize(("first", "second"), [*product(MESHES, MESHES)])
def test_faces_survive_every_pair_of_meshes(tmp_path: Path, first: str, second: str) -> None:
    cloud = rich_cloud()
    assert cloud.faces is not None
    corners = cloud.points[cloud.faces]
    once, _ = written(tmp_path, first, replace(cloud, points=cloud.points - cloud.points[0]))
    twice, _ = written(tmp_path, second, once)
    for found in (once, twice):
        assert found.faces is not None
        shifted = found.points[found.faces] + cloud.points[0]
        np.testing.assert_allclose(shifted, corners, rtol=0, atol=1e-4)


@pytest.mark.parametrize("format", [name for name, writer in WRITERS.items() if writer.open])
def test_pieces_make_the_same_file(tmp_path: Path, format: str) -> None:
    cloud = replace(rich_cloud(), faces=None)
    cloud.points[:, 0].sort()
    whole = written(tmp_path, format, cloud)
    notes = write_pieces(tmp_path / "b", format, lambda: cut(cloud, [1, 2, COUNT // 2]))
    pieces = read_points(tmp_path / "b", attributes=True)
    np.testing.assert_array_equal(pieces.points, whole[0].points)
    assert list(pieces.attributes) == list(whole[0].attributes)
    for name, column in whole[0].attributes.items():
        np.testing.assert_array_equal(pieces.attributes[name], column, err_msg=name)
    assert {re.sub(r"0[.]\d+", "", note) for note in whole[1]} == {
        re.sub(r"0[.]\d+", "", note) for note in notes
    }
    if format not in ("las", "laz", "e57"):  # these hold the time, or an id
        assert (tmp_path / "b").read_bytes() == (tmp_path / f"a.{format}").read_bytes()


def cut(cloud: DecodedCloud, places: list[int]) -> Iterator[DecodedCloud]:
    for start, end in pairwise([0, *places, len(cloud.points)]):
        kept = {name: column[start:end] for name, column in cloud.attributes.items()}
        yield replace(cloud, points=cloud.points[start:end], attributes=kept)


def test_pieces_are_refused_where_a_format_is_written_whole(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedFileError, match="write one of ply, pcd, las, laz"):
        write_pieces(tmp_path / "a.glb", "glb", lambda: iter([rich_cloud()]))


def test_glb_keeps_places_far_from_zero(tmp_path: Path) -> None:
    found, _ = written(tmp_path, "glb", rich_cloud())
    np.testing.assert_allclose(found.points, rich_cloud().points, rtol=0, atol=1e-5)
    np.testing.assert_array_equal(colors_of(found), colors_of(rich_cloud()))


@pytest.mark.parametrize("format", sorted(set(WRITERS) - set(MESHES)))
def test_lost_faces_are_named(tmp_path: Path, format: str) -> None:
    _, warnings = written(tmp_path, format, rich_cloud())
    assert any("faces" in warning for warning in warnings)


def test_stl_without_faces_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedFileError, match="PLY"):
        write_cloud(tmp_path / "a.stl", "stl", replace(rich_cloud(), faces=None))


@pytest.mark.parametrize("format", [item for item in WRITERS if item != "stl"])
def test_points_without_coordinates_keep_their_place_or_are_named(
    tmp_path: Path, format: str
) -> None:
    points = rich_cloud().points.copy()
    points[5] = np.nan
    found, warnings = written(tmp_path, format, DecodedCloud(points, "ply"))
    is_told = any("left out" in warning for warning in warnings)
    assert len(found.points) == COUNT - is_told
    finite = found.points[np.isfinite(found.points).all(axis=1)]
    np.testing.assert_allclose(finite, np.delete(points, 5, axis=0), rtol=0, atol=6e-4)


@pytest.mark.parametrize("format", [item for item in WRITERS if item != "stl"])
def test_empty_clouds_are_written(tmp_path: Path, format: str) -> None:
    empty = DecodedCloud(np.empty((0, 3)), "ply", attributes={"intensity": np.empty(0, "u2")})
    write_cloud(tmp_path / "a", format, empty)


def test_doubles_stay_doubles(tmp_path: Path) -> None:
    points = POINTS.astype(np.float64) + np.array([500_000.000123, 4_000_000.000456, 0])
    write_ply(tmp_path / "utm.ply", points)
    np.testing.assert_array_equal(read_points(tmp_path / "utm.ply").points, points)
    write_ply(tmp_path / "a.ply", POINTS)
    cloud = read_points(tmp_path / "a.ply")
    assert cloud.points.dtype == np.float32
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert cloud.warnings == ()


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("intensity", np.linspace(0, 1, 40, dtype=np.float32)),
        ("intensity", np.linspace(-2048, 2047, 40)),
        ("classification", np.full(40, 300)),
        ("return_number", np.full(40, 20)),
        ("synthetic", np.full(40, 7)),
        ("scan_angle_rank", np.linspace(-90.5, 90.25, 40)),
        ("X", np.arange(40)),
        ("a" * 40, np.arange(40)),
        ("points", np.arange(40)),
    ],
)
def test_what_las_cannot_hold_is_in_extra_bytes(
    tmp_path: Path, name: str, values: NDArray[Any]
) -> None:
    attributes = {name: values, f"{name}{'b' * 9}": -values}
    cloud = DecodedCloud(POINTS, "ply", attributes=attributes)
    found, warnings = written(tmp_path, "laz", cloud)
    np.testing.assert_allclose(found.points, POINTS, atol=1e-4)
    columns = [column.astype(float) for column in found.attributes.values()]
    is_angle = name.startswith("scan_angle")
    columns += [column * 0.006 for column in columns] if is_angle else []
    for wanted in (values, -values):
        assert any(np.allclose(c, wanted, atol=0.003 if is_angle else 0) for c in columns)
    assert is_angle or name == "points" or any(name[:40] in warning for warning in warnings)


def test_las_keeps_records_scale_format_and_time(tmp_path: Path) -> None:
    metadata = LasMetadata("1.2", 3, 0.01, True, (LasRecord("lab", 7, "kept", b"abc"),))
    crs = (LasRecord("LASF_Projection", 2112, "", b'PROJCS["UTM 32N"]\0'),)
    full = rich_cloud()
    names = ("red", "green", "blue", "intensity", "gps_time")
    attributes = {name: full.attributes[name] for name in names}
    cloud = DecodedCloud(full.points, "las", attributes=attributes, las=metadata, crs=crs)
    write_cloud(tmp_path / "a.laz", "laz", cloud)
    with laspy.open(tmp_path / "a.laz") as file:
        header = file.header
    assert (header.point_format.id, header.scales.tolist()) == (3, [0.01] * 3)
    assert header.global_encoding.gps_time_type == laspy.header.GpsTimeType.STANDARD
    assert header.global_encoding.wkt
    assert (tmp_path / "a.laz").stat().st_size < 8000
    back = read_points(tmp_path / "a.laz", attributes=True)
    assert back.las is not None
    assert (back.las.records, back.crs) == (metadata.records, crs)
    assert read_crs(tmp_path / "a.laz") == crs
    told = "the coordinate system, UTM 32N, is left out: write LAS or LAZ"
    for format in WRITERS:
        if format not in ("las", "laz", "stl"):
            assert told in write_cloud(tmp_path / "other", format, cloud)
    assert told in write_pieces(tmp_path / "other", "ply", lambda: iter([cloud]))


def test_colors_of_16_bits_become_8_and_back(tmp_path: Path) -> None:
    eight = np.arange(40, dtype=np.uint8) * 6
    for wide in (eight.astype(np.uint16) * 257, eight.astype(np.uint16) * 256):
        attributes = dict.fromkeys(("red", "green", "blue"), wide)
        cloud = DecodedCloud(POINTS, "las", attributes=attributes)
        found, warnings = written(tmp_path, "ply", cloud)
        assert warnings == ()
        np.testing.assert_array_equal(found.attributes["red"], eight)
        found, _ = written(tmp_path, "laz", found)
        np.testing.assert_array_equal(found.attributes["red"], eight.astype(np.uint16) * 257)
    uneven = dict.fromkeys(("red", "green", "blue"), np.arange(40, dtype=np.uint16) * 999)
    _, warnings = written(tmp_path, "ply", DecodedCloud(POINTS, "las", attributes=uneven))
    assert warnings == ("the colours are rounded to 8 bits",)


def test_trimesh_and_laspy_agree(tmp_path: Path) -> None:
    cloud = rich_cloud()
    for format in ("ply", "obj", "glb"):
        write_cloud(tmp_path / f"a.{format}", format, cloud)
        mesh = trimesh.load_scene(tmp_path / f"a.{format}", process=False).dump()[0]
        assert len(mesh.faces) == 60
        corners = cloud.points[cloud.faces]
        np.testing.assert_allclose(mesh.vertices[mesh.faces], corners, rtol=0, atol=1e-3)
        colors = np.asarray(mesh.visual.vertex_colors)[mesh.faces][..., :3]
        np.testing.assert_array_equal(colors, colors_of(cloud)[cloud.faces])
    write_cloud(tmp_path / "a.las", "las", cloud)
    las = laspy.read(tmp_path / "a.las")
    np.testing.assert_array_equal(las.intensity, cloud.attributes["intensity"])
    np.testing.assert_array_equal(las.classification, cloud.attributes["classification"])
    np.testing.assert_array_equal(las.red, cloud.attributes["red"].astype(int) * 257)
    np.testing.assert_array_equal(las.roughness, cloud.attributes["roughness"])


@pytest.mark.slow
@pytest.mark.parametrize("format", ["ply", "pcd"])
def test_open3d_agrees(tmp_path: Path, format: str) -> None:
    o3d = pytest.importorskip("open3d")
    points = rich_cloud().points
    cloud = replace(rich_cloud(), points=points - points[0])
    write_cloud(tmp_path / f"a.{format}", format, cloud)
    found = o3d.io.read_point_cloud(str(tmp_path / f"a.{format}"))
    np.testing.assert_allclose(np.asarray(found.points), cloud.points, atol=1e-5)
    np.testing.assert_allclose(np.asarray(found.normals), unit_normals(cloud), atol=1e-6)
    np.testing.assert_array_equal(np.rint(np.asarray(found.colors) * 255), colors_of(cloud))


def test_names_stay_different_and_legal(tmp_path: Path) -> None:
    names = ("two words", "two_words", "tab\there", "ünï", "a,b", 'q"', "", "Y")
    attributes = {name: np.full(40, i, np.float32) for i, name in enumerate(names)}
    for format in FULL:
        found, _ = written(tmp_path, format, DecodedCloud(POINTS, "ply", attributes=attributes))
        values = {int(column[0]) for column in found.attributes.values() if np.ptp(column) == 0}
        assert set(range(len(names))) <= values, format
        np.testing.assert_allclose(found.points, POINTS, atol=1e-4)


@pytest.mark.parametrize("format", ["las", "npy"])
def test_names_in_other_letters_come_back(tmp_path: Path, format: str) -> None:
    names = ("интенсивность", "größe", "強度")
    columns = {name: np.arange(3.0) + i for i, name in enumerate(names)}
    cloud = DecodedCloud(np.eye(3), "ply", attributes=columns)
    write_cloud(tmp_path / "cloud", format, cloud)
    read = read_points(tmp_path / "cloud", attributes=True).attributes
    assert {name: read[name].tolist() for name in names if name in read} == {
        name: column.tolist() for name, column in columns.items()
    }
