"""PCD files, their viewpoint and their damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.factories.cloud_files import POINTS, pcd
from tests.factories.decoding import decode, reason_of_refusal


def test_pcd_viewpoint(tmp_path: Path) -> None:
    assert decode(tmp_path, pcd()).viewpoints == ((1, 2, 3, 1, 0, 0, 0),)


def test_trailing_bytes_are_reported(tmp_path: Path) -> None:
    assert "bytes after" in decode(tmp_path, pcd() + b"more").warnings[0]


UNCLEAR = {
    "PCD without x": (pcd().replace(b"_ x y", b"_ w y"), "FIELDS"),
    "PCD counts disagree": (pcd().replace(b"WIDTH 20", b"WIDTH 21"), "WIDTH x HEIGHT is 42"),
    "PCD types and sizes disagree": (pcd().replace(b"SIZE 4 ", b"SIZE "), "differ: 8, 7"),
}


@pytest.mark.parametrize("case", UNCLEAR)
def test_what_is_not_clear_is_an_error_that_names_the_place(tmp_path: Path, case: str) -> None:
    content, words = UNCLEAR[case]
    assert words in reason_of_refusal(tmp_path, content)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"WIDTH 20\nHEIGHT 2", b"WIDTH 0\nHEIGHT 0"),
        (b"DATA ascii", b"DATA ASCII"),
        (b"# .PCD", b"\xef\xbb\xbf# .PCD"),
    ],
    ids=["no width", "upper case", "byte order mark"],
)
def test_headers_of_other_writers(tmp_path: Path, old: bytes, new: bytes) -> None:
    content = pcd("ascii")
    assert old in content
    np.testing.assert_array_equal(decode(tmp_path, content.replace(old, new)).points, POINTS)
