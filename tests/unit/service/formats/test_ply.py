"""PLY files, also with lists and damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import TruncatedFileError, UnsupportedFileError, read_points
from tests.factories.cloud_files import POINTS, ply
from tests.factories.decoding import decode, decode_frugally, reason_of_refusal, write_file


def test_trailing_bytes_are_reported(tmp_path: Path) -> None:
    assert "bytes after" in decode(tmp_path, ply() + b"more").warnings[0]


UNCLEAR = {
    "two vertex elements": (
        ply().replace(b"obj_info made by hand", b"element vertex 40"),
        "'vertex'",
    ),
    "no z": (ply().replace(b"float z", b"float w"), "'z'"),
    "a property twice": (ply().replace(b"float y", b"float x"), "line 7"),
}


@pytest.mark.parametrize("case", UNCLEAR)
def test_what_is_not_clear_is_an_error_that_names_the_place(tmp_path: Path, case: str) -> None:
    content, words = UNCLEAR[case]
    assert words in reason_of_refusal(tmp_path, content)


def test_a_cut_names_the_byte(tmp_path: Path) -> None:
    found = decode_frugally(tmp_path, ply(lists="inside")[:-1])
    assert isinstance(found, TruncatedFileError)
    assert "39 of 40 rows" in str(found)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_empty_elements_need_no_properties(tmp_path: Path, form: str) -> None:
    content = ply(form).replace(b"end_header", b"element face 0\nend_header")
    np.testing.assert_array_equal(decode(tmp_path, content).points, POINTS)


def test_numbers_beyond_their_type_do_not_wrap(tmp_path: Path) -> None:
    head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
    head += "property float z\nproperty uchar a\nproperty uchar b\nend_header\n"
    content = (head + "1 2 3 300 7\n4 5 6 1 8\n").encode()
    kept = read_points(write_file(tmp_path, content), attributes=True).attributes
    assert kept["a"].tolist() == [300, 1]
    assert kept["b"].dtype == np.uint8


@pytest.mark.parametrize(
    ("comment", "is_told"),
    [
        ("epsg: 25832", True),
        ('crs PROJCS["ETRS89 / UTM zone 32N"]', True),
        ("+proj=utm +zone=32", True),
        ("Created by Blender 4.2", False),
    ],
)
def test_a_coordinate_system_in_a_comment_is_told(
    tmp_path: Path, comment: str, *, is_told: bool
) -> None:
    content = ply(form="ascii").replace(b"element", f"comment {comment}\nelement".encode(), 1)
    warnings = read_points(write_file(tmp_path, content), attributes=True).warnings
    assert any(comment in text and "not kept" in text for text in warnings) == is_told


def test_packed_splats_are_named(tmp_path: Path) -> None:
    content = ply().replace(b"float x", b"uint packed_position")
    with pytest.raises(UnsupportedFileError, match="SuperSplat"):
        read_points(write_file(tmp_path, content))
