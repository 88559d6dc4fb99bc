"""Delimited text in every dialect gives the points that it holds."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.formats import CloudFileError, FileLimitError, ReadLimits
from tests.factories.cloud_files import NORMALS, POINTS, text_rows
from tests.factories.decoding import decode, reason_of_refusal

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
}


@pytest.mark.parametrize("case", UNCLEAR)
def test_what_is_not_clear_is_an_error_that_names_the_place(tmp_path: Path, case: str) -> None:
    content, words = UNCLEAR[case]
    assert words in reason_of_refusal(tmp_path, content)


def rows(delimiter: str, before: str = "", after: str = "") -> bytes:
    """The points as rows with further fields before and after them; {i} is the row's index."""
    lines = text_rows(POINTS, delimiter).decode().splitlines()
    return "".join(
        before.format(i=i) + line + after.format(i=i) + "\n" for i, line in enumerate(lines)
    ).encode()


COLMAP = (
    b"# 3D point list with one line of data per point:\n"
    b"#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
)
LIVOX = b"Version,Type,Timestamp,X,Y,Z,Tag\n47MDN000000000,0.0,0.0,2,9,12975552\n"
BY_NAME = {
    "a delimiter at the end of each row": b"time,x,y,z\n" + rows(",", "{i},", ","),
    "a delimiter at the end of all lines": b"time;x;y;z;\n" + rows(";", "{i};", ";"),
    "COLMAP": COLMAP + rows(" ", "{i} ", " 90 80 70 0.5 3 17"),
    "COLMAP, a track of eight entries": COLMAP + rows(" ", "{i} ", " 90 80 70 0.5 1 2 3 4 5 6 7 8"),
    "Livox, a line between header and rows": LIVOX + rows(",", "0,1,{i},", ",10"),
    "units under the names": b"I,X,Y,Z\n[-],[m],[m],[m]\n" + rows(",", "{i},"),
    "signs for units": b"I;X;Y;Z\n-;m;m;m\n" + rows(";", "{i};"),
    "pandas without names": b"0,1,2\n" + rows(","),
    "pandas with its index": b",0,1,2\n" + rows(",", "{i},"),
    "pandas with index and names": b",x,y,z\n" + rows(",", "{i},"),
    "VeloView": b"i,Points_m_XYZ:0,Points_m_XYZ:1,Points_m_XYZ:2\n" + rows(",", "{i},"),
    "ArcGIS": b"OBJECTID,POINT_X,POINT_Y,POINT_Z\n" + rows(",", "{i},"),
    "German survey": "Nr;Rechtswert;Hochwert;Höhe\n".encode()
    + rows(";", "{i};").replace(b".", b","),
    "letters": b"Id\tE\tN\tH\n" + rows("\t", "{i}\t"),
    "units in names": b"t,x_m,y_m,z_m\n" + rows(",", "{i},"),
    "Ouster": b"TIMESTAMP (ns), X1 (m), Y1 (m), Z1 (m)\n" + rows(",", "{i},"),
    "commas in the header, blanks in the rows": b"t, X, Y, Z\n" + rows(" ", "{i} "),
    "quoted numbers": b"x,y,z\n" + rows('","', '"', '"'),
    "decimal commas between blanks": rows(" ").replace(b".", b","),
    "decimal commas after the first row": b"7;8;9\n" + rows(";").replace(b".", b","),
    "PTS in two blocks": b"40\n" + rows(" ") + b"2\n1 2 3\n4 5 6\n",
    "old Mac line ends": rows(" ").replace(b"\n", b"\r"),
    "UTF-16": ("x,y,z\n" + rows(",").decode()).encode("utf-16"),
    "UTF-16 without a mark": rows(" ").decode().encode("utf-16-be"),
    "a header before each block": b"x,y,z\n" + rows(",").replace(b"\n", b"\nx,y,z\n", 20),
    "bars": b"x|y|z\n" + rows("|"),
    "units of their own in the header": b"# Z [m] Y [m] X [m]\n"
    + text_rows(np.ascontiguousarray(POINTS[:, ::-1])),
    "a column that counts": rows(" ", "{i} "),
    "a column of labels": rows(" ", "P{i} "),
    "surveyors, labels": "Punkt;Ostwert;Nordwert;Höhe\n".encode() + rows(";", "P{i};"),
    "Spanish": b"id,Este,Norte,Cota\n" + rows(",", "{i},"),
    "x, y and a height": b"id,x,y,alt\n" + rows(",", "{i},"),
    "words around the axes": b"id,x_coord,y_coord,z_coord\n" + rows(",", "{i},"),
    "axes in a folder": b"stamp,point.x,point.y,point.z\n" + rows(",", "{i},"),
    "two kinds of axes": b"acc.x,acc.y,acc.z,pos.x,pos.y,pos.z\n" + rows(",", "1,2,3,"),
    "words before the axes": b"//Coord. X,Coord. Y,Coord. Z,R,G,B\n" + rows(",", "", ",1,2,3"),
    "blanks of a word processor": rows(" ").decode().replace(" ", "\N{NO-BREAK SPACE}").encode(),
    "minus signs of a word processor": rows(" ").decode().replace("-", "\N{MINUS SIGN}").encode(),
    "empty rows at the end": b"x,y,z,i\n" + rows(",", "", ",{i}") + b",,,\n" * 3,
}


@pytest.mark.parametrize("case", BY_NAME)
def test_columns_are_found(tmp_path: Path, case: str) -> None:
    points = decode(tmp_path, BY_NAME[case]).points.astype(np.float32)
    added = {"decimal commas after the first row": 1}.get(case, 0)
    more = {"PTS in two blocks": 2, "empty rows at the end": 3}.get(case, 0)
    np.testing.assert_array_equal(points[added : added + 40], POINTS)
    assert len(points) == added + 40 + more


REFUSED = {
    "fewer names than fields": (
        b"time,range,azimuth\n" + rows(",", "{i},"),
        "3 columns, but line 2",
    ),
    "more names than fields": (b"Point ID X Y Z\n" + rows(" ", "{i} "), "5 columns, but line 2"),
    "other names in a comment": (
        b"# SHOTNUMBER TIME RANGE INTENSITY\n" + rows(" ", "{i} "),
        "expected the names x, y and z",
    ),
    "degrees": (b"lat,lon,alt,intensity\n" + rows(",", "", ",{i}"), "geographic"),
    "degrees in a comment": (b"# LFID GLON GLAT ZG\n" + rows(" ", "{i} "), "geographic"),
    "decimal points and commas": (b"1.5;2.5;3.5\n1,5;2,5;3,5\n", "some have commas"),
    "thousands": (b"1.5;2.5;3.5\n1,500.5;2.5;3.5\n", "not a number|some have commas"),
    "PTS with rows missing": (b"40\n" + rows(" ") + b"9\n1 2 3\n", "announces 49"),
    "poses of KITTI": (b"1 0 0 1.5 0 1 0 2 0 0 1 3\n" * 9, "trajectory"),
    "poses of TUM": (rows(" ", "{i}.5 ", " 0 0 0 1"), "trajectory"),
    "a matrix": (b"1 0 0 5\n0 1 0 6\n0 0 1 7\n0 0 0 1\n", "matrix"),
    "polar coordinates": (b"range,azimuth,elevation\n" + rows(","), "convert other coordinates"),
    "axes that are no place": (b"t,acc.x,acc.y,acc.z\n" + rows(",", "{i},"), "expected the names"),
    "commas for both": (b"1,083,-2,128,3,004\n1,5,2,5,3,007\n", "as well as separators"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_contradicts_is_refused(tmp_path: Path, case: str) -> None:
    found = REFUSED[case]
    content, words = found
    with pytest.raises(CloudFileError, match=words):
        decode(tmp_path, content)


def test_the_columns_that_were_taken_are_named(tmp_path: Path) -> None:
    cloud = decode(tmp_path, b"made by hand\n" + rows(" ", "", " {i}"))
    assert "columns 1, 2 and 3 of 4" in " ".join(cloud.warnings)
    cloud = decode(tmp_path, b"left,right,over\n" + rows(","))
    assert "'left, right, over' are read as x, y, z" in " ".join(cloud.warnings)


@pytest.mark.parametrize(
    "word", ["", "NA", "-1.#IND", "-nan(ind)", "1.#QNAN", "null", "<NA>", "--"]
)
def test_rows_without_values_are_nan(tmp_path: Path, word: str) -> None:
    lines = text_rows(POINTS, ",").splitlines()
    lines[5] = ",".join([word] * 3).encode()
    points = decode(tmp_path, b"x,y,z\n" + b"\n".join(lines) + b"\n").points
    assert np.isnan(points[5]).all()
    np.testing.assert_array_equal(
        np.delete(points, 5, 0).astype(np.float32), np.delete(POINTS, 5, 0)
    )


names_of_columns = st.permutations(["x", "y", "z", "intensity", "ring"])


@given(
    names=names_of_columns,
    delimiter=st.sampled_from([",", ";", "\t", " "]),
    trailing=st.booleans(),
    quoted=st.booleans(),
    decimal_comma=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_named_columns_are_found_in_every_order(
    names: list[str], delimiter: str, trailing: bool, quoted: bool, decimal_comma: bool
) -> None:
    table = dict(zip("xyz", POINTS.T, strict=True)) | {
        "intensity": np.linspace(0, 1, 40),
        "ring": np.arange(40),
    }
    end = delimiter if trailing and delimiter != " " else ""
    mark = '"' if quoted and not decimal_comma else ""
    lines = [delimiter.join(names)]
    for i in range(40):
        fields = [mark + f"{table[name][i]:.9g}" + mark for name in names]
        if decimal_comma and delimiter != ",":
            fields = [item.replace(".", ",") for item in fields]
        lines.append(delimiter.join(fields) + end)
    with tempfile.TemporaryDirectory() as folder:
        points = decode(Path(folder), "\n".join([*lines, ""]).encode()).points
    np.testing.assert_array_equal(points.astype(np.float32), POINTS)


def test_columns_without_names_are_never_taken_silently(tmp_path: Path) -> None:
    cloud = decode(tmp_path, rows(" ", "", " {i} 7"))
    assert "columns 1, 2 and 3 of 5" in " ".join(cloud.warnings)
    assert decode(tmp_path, rows(" ")).warnings == ()
    assert decode(tmp_path, b"40\n" + rows(" ", "", " {i} 7 8 9")).warnings == ()


def test_lines_beyond_the_limit_are_named(tmp_path: Path) -> None:
    """Wherever the line lies: its length is known without looking at the others' one by one."""
    limit = ReadLimits().max_line_bytes
    for before in (0, 9, 3 * limit // 16, (1 << 20) // 16 - 900, (1 << 20) // 16 + 1):
        for length, is_long in ((limit, False), (limit + 2, True)):
            end = b"1 2 3 " + b"a" * (length - 7) + b"\n"
            content = b"1.00 2.00 3.000\n" * before + end + b"4 5 6\n"
            if not is_long:
                assert len(decode(tmp_path, content).points) == before + 2
                continue
            with pytest.raises(FileLimitError, match=f"line {before + 1}: longer than {limit}"):
                decode(tmp_path, content)
