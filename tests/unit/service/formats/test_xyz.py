"""Delimited text in every dialect gives the points that it holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import MalformedFileError
from tests.factories.cloud_files import NORMALS, POINTS, text_rows
from tests.factories.decoding import decode

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


def test_double_precision_survives(tmp_path: Path) -> None:
    points = POINTS.astype(np.float64) + np.array([500_000.000123, 4_000_000.000456, 0])
    text = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist()).encode()
    np.testing.assert_array_equal(decode(tmp_path, text).points, points)


def test_guesses_are_reported(tmp_path: Path) -> None:
    assert "line 1 to 2" in decode(tmp_path, DIALECTS["stray lines"]).warnings[0]
    assert "may have been cut" in decode(tmp_path, DIALECTS["no newline at the end"]).warnings[0]


def test_nan_rows_are_kept(tmp_path: Path) -> None:
    rows = text_rows(POINTS) + b"nan nan nan\nNaN NaN NaN\n"
    points = decode(tmp_path, rows).points
    assert np.isnan(points).all(axis=1).tolist() == [False] * 40 + [True] * 2


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
    "a count above the rows": (b"41\n" + text_rows(POINTS), "40 rows, but announces 41"),
    "old Mac line ends": (text_rows(POINTS, " ", "\r"), "line 1"),
}


@pytest.mark.parametrize("case", UNCLEAR)
def test_what_is_not_clear_is_an_error_that_names_the_place(tmp_path: Path, case: str) -> None:
    content, words = UNCLEAR[case]
    with pytest.raises(MalformedFileError) as caught:
        decode(tmp_path, content)
    assert words in str(caught.value)
