"""Meshes: their vertices and faces."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from service.formats import CloudFileError, ReadLimits, read_pieces, read_points
from service.formats.errors import short_reason
from tests.factories.cloud_files import POINTS, text_rows
from tests.factories.decoding import decode, write_file
from tests.factories.scanner_files import (
    DOUBLES,
    FACES,
    colored_off,
    glb,
    gltf,
    stl_ascii,
    stl_binary,
)

REAL = [
    ("formats/mesh.obj", 5623, (8.902039, 14.477572, 22.889115)),
    ("blade/nasa_blade.stl", 7120, (0.0556573, 0.0405973, 0.02)),
]


@pytest.mark.parametrize("first", ["4 2 0", "# mesh\n4 2 0", "4 2", "off\n4 2 0", "OFF4 2 0"])
def test_off_is_known_without_its_keyword(tmp_path: Path, first: str) -> None:
    corners = [[0, 0, 0], [1.5, 0, 0], [0, 1, 0], [0, 0, 2.5]]
    rows = [" ".join(map(str, row)) for row in corners] + ["3 0 1 2", "3 0 1 3"]
    content = "\n".join([first, *rows]) + "\n"
    cloud = read_points(write_file(tmp_path, content.encode()), attributes=True)
    np.testing.assert_array_equal(cloud.points, corners)
    assert cloud.faces is not None
    assert len(cloud.faces) == 2


@pytest.mark.parametrize("first", ["OFF BINARY\n", "4OFF\n4 2 0\n", "nOFF\n5\n4 2 0\n"])
def test_other_kinds_of_off_are_named(tmp_path: Path, first: str) -> None:
    path = write_file(tmp_path, (first + "0 0 0 1 2\n" * 6).encode())
    with pytest.raises(CloudFileError, match="OFF in binary or of n dimensions"):
        read_points(path)


def test_normals_and_colours_of_an_off(tmp_path: Path) -> None:
    path = write_file(tmp_path, colored_off())
    for limits in (None, ReadLimits(max_points=16)):
        (cloud, *_) = read_pieces(path, limits, attributes=True)
        assert list(cloud.attributes) == ["nx", "ny", "nz", "red", "green", "blue"]
        assert cloud.attributes["green"].dtype == np.uint8
        np.testing.assert_array_equal(cloud.attributes["green"], np.arange(40))
        np.testing.assert_array_equal(cloud.attributes["nz"], np.full(40, 0.8))
    assert (
        "1 columns behind the coordinates are not kept"
        in read_points(path, attributes=True).warnings
    )


def test_colours_of_an_stl_are_told(tmp_path: Path) -> None:
    """VisCAM marks them in the two bytes behind each triangle, Materialise in the header too."""
    plain = stl_binary()
    colored = plain[:182] + struct.pack("<H", 0x8000 | 31) + plain[184:]
    materialise = b"COLOR=\xff\0\0\xff,MATERIAL=".ljust(80) + colored[80:]
    for content, words in (
        (colored, "(VisCAM) or other numbers of 1"),
        (materialise, "(Materialise)"),
    ):
        path = write_file(tmp_path, content)
        (warning,) = read_points(path, attributes=True).warnings
        assert words in warning
        assert "not kept" in warning
        *_, last = read_pieces(path, ReadLimits(max_points=16), attributes=True)
        assert warning in last.warnings
        assert read_points(path).warnings == ()
    assert read_points(write_file(tmp_path, plain), attributes=True).warnings == ()


STL = {
    "two solids": stl_ascii() + stl_ascii(),
    "CR LF and capitals": stl_ascii().upper().replace(b"\n", b"\r\n"),
    "a long name": stl_ascii().replace(b"made by hand", b"x" * 3000),
    "a binary solid": b"solid".ljust(80) + stl_binary()[80:],
    "normals that are none": stl_binary().replace(struct.pack("<3f", 0, 0, 1), b"\0\0\xc0\x7f" * 3),
}


@pytest.mark.parametrize("name", STL)
def test_stl_as_programs_write_it(tmp_path: Path, name: str) -> None:
    cloud = read_points(write_file(tmp_path, STL[name]), faces=True)
    np.testing.assert_allclose(cloud.points, DOUBLES[:39], rtol=1e-6)
    assert cloud.faces is not None
    assert len(cloud.faces) == 13 * (1 + (name == "two solids"))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"\nvertex", b" vertex", "0 lines begin with 'vertex'"),
        (b"vertex", b"corner", "0 lines begin with 'vertex'"),
        (b"endsolid", b"end", "before 'endsolid'"),
        (b".", b"'", "line 4: .* is not a number"),
    ],
)
def test_what_is_wrong_with_an_stl_is_told(
    tmp_path: Path, old: bytes, new: bytes, words: str
) -> None:
    with pytest.raises(CloudFileError, match=words):
        read_points(write_file(tmp_path, stl_ascii().replace(old, new)))


@pytest.mark.real_data
@pytest.mark.parametrize(("name", "count", "extent"), REAL)
def test_files_of_real_tools(
    data: Path, name: str, count: int, extent: tuple[float, float, float]
) -> None:
    points = read_points(data / name).points
    assert points.shape == (count, 3)
    np.testing.assert_allclose(np.ptp(points, axis=0), extent, rtol=1e-5)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (glb(accessors=[{"componentType": 5126, "count": 10**9, "type": "VEC3"}]), "sparse"),
        (glb(buffers=[{"byteLength": 9, "uri": "file:///etc/passwd"}]), "other files"),
        (glb(buffers=[{"byteLength": 9, "uri": "http://127.0.0.1/x"}]), "other files"),
        (glb(nodes=[{"mesh": 0, "children": [1, 1]}, {"mesh": 0}]), "two parents"),
        (glb(nodes=[{"mesh": 0}] * 9 + [{"mesh": -9}]), "not valid"),
        (glb(nodes=[{"mesh": 0}] * 200_000), "too many"),
        (glb(extensionsRequired=["EXT_meshopt_compression"]), "compressed by meshopt"),
    ],
)
def test_refused(tmp_path: Path, content: bytes, words: str) -> None:
    path = write_file(tmp_path, content)
    with pytest.raises(CloudFileError, match=words):
        read_points(path)


FACES_TEXT = b"".join(b"3 %d %d %d\n" % tuple(face) for face in FACES)
OFF_FILES = {
    "ModelNet": b"OFF40 38 0\n" + text_rows(POINTS) + FACES_TEXT,
    "comment behind the counts": b"\t  OFF40 38 0 # or nah\n" + text_rows(POINTS) + FACES_TEXT,
    "two counts": b"OFF\n40 38\n" + text_rows(POINTS) + FACES_TEXT,
    "counts in the first line": b"OFF 40 38 0\n" + text_rows(POINTS) + FACES_TEXT,
    "colours": b"COFF\n40 0 0\n" + text_rows(POINTS, " ", " 255 0 0 255\n"),
}


@pytest.mark.parametrize("case", OFF_FILES)
def test_off_headers(tmp_path: Path, case: str) -> None:
    cloud = decode(tmp_path, OFF_FILES[case])
    assert cloud.format == "off"
    np.testing.assert_array_equal(cloud.points.astype(np.float32), POINTS)


@pytest.mark.parametrize("first", ["g", "o", "s off", "\ufeffv 0 0 0", "  v 0 0 0", "vp 1 2"])
def test_obj_first_lines(tmp_path: Path, first: str) -> None:
    content = f"{first}\n".encode() + b"".join(
        b"v " + row + b"\n" for row in text_rows(POINTS).splitlines()
    )
    cloud = decode(tmp_path, content)
    assert cloud.format == "obj"
    np.testing.assert_array_equal(cloud.points[-40:].astype(np.float32), POINTS)


def test_gltf_with_its_asset_at_the_end(tmp_path: Path) -> None:
    document = json.loads(gltf())
    asset = document.pop("asset")
    content = json.dumps(document | {"extras": "x" * 5000, "asset": asset}).encode()
    np.testing.assert_allclose(decode(tmp_path, content).points, DOUBLES, atol=2e-5)


def test_pictures_in_other_files_are_not_needed(tmp_path: Path) -> None:
    content = glb(images=[{"uri": "../../etc/picture.jpg"}])
    np.testing.assert_allclose(decode(tmp_path, content).points, DOUBLES, atol=2e-5)


@pytest.mark.parametrize(
    "uri",
    ["data:/0123abcd", "data:/ab?;base64,", "data:application/octet-stream,abc", "a.bin"],
)
def test_buffers_are_embedded_in_base64(tmp_path: Path, uri: str) -> None:
    """Other URIs would be resolved as names of files beside the cloud."""
    with pytest.raises(CloudFileError, match="other files"):
        decode(tmp_path, glb(buffers=[{"byteLength": 9, "uri": uri}]))


def test_a_library_s_words_name_no_path() -> None:
    error = ValueError("escapes root '/var/lib/mpe/blobs/f9' or C:\\data\\x, rows/columns 1/2")
    assert short_reason(error) == "escapes root '(path)' or (path) rows/columns 1/2"
    assert short_reason(FileNotFoundError(2, "No such file", "/var/lib/mpe")) == "No such file"
