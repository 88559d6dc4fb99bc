"""Tables of surveyors, spreadsheets and other programs: read rightly, or refused with a reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import CloudFileError, read_points, text_table
from tests.factories.cloud_files import POINTS
from tests.factories.decoding import write_file

ROWS = [tuple(f"{value:.3f}" for value in point) for point in POINTS.tolist()]


def table(header: str, form: str) -> bytes:
    """Lines of the form, with the row's number as i, and x, y, z."""
    lines = [form.format(i=i + 1, x=x, y=y, z=z) for i, (x, y, z) in enumerate(ROWS)]
    return (header + "\n" * bool(header) + "\n".join(lines) + "\n").encode()


READ = {
    "Portuguese": ("Ponto;Leste;Norte;Altitude", "P{i};{x};{y};{z}"),
    "Dutch": ("Punt;X-coördinaat;Y-coördinaat;Hoogte", "{i};{x};{y};{z}"),
    "Norwegian": ("Punktnr;Nord;Øst;Høyde", "{i};{y};{x};{z}"),
    "Russian": ("Точка;Север;Восток;Высота", "{i};{y};{x};{z}"),
    "Chinese": ("点号,东坐标,北坐标,高程", "{i},{x},{y},{z}"),
    "Japanese": ("点名,X座標,Y座標,標高", "T{i},{x},{y},{z}"),
    "QGIS": ("id,xcoord,ycoord,zcoord", "{i},{x},{y},{z}"),
    "text with a delimiter": ("name,id,x,y,z", '"a, b",{i},{x},{y},{z}'),
    "names with a delimiter": ('"a, b";x;y;z', '"P {i}";{x};{y};{z}'),
    "geometry and columns": ("wkt\tfid\tx\ty\tz", "PointZ ({x} {y} {z})\t{i}\t{x}\t{y}\t{z}"),
    "a word and a number": ("", "Point {i} {x} {y} {z} 0 0 1"),
}


@pytest.mark.parametrize("name", READ)
def test_tables_are_read(tmp_path: Path, name: str) -> None:
    cloud = read_points(write_file(tmp_path, table(*READ[name])))
    np.testing.assert_allclose(cloud.points, POINTS, rtol=0, atol=6e-4)


REFUSED = {
    "rows and columns": (("", "{i} 7 {x} {y} {z} 1 2 3"), "names the columns"),
    "2 columns": (("", "{x} {y}"), "rows of two numbers"),
    "touching": (("", "1.5-{x}-{y}-{z}"), "touch"),
    "thousands": (("E;N;H", "2'600'{i:03}.5;1'200'000.5;400.1"), "thousands"),
    "WKT": (("WKT,id", '"POINT Z ({x} {y} {z})",{i}'), "WKT"),
    "poses": (("", "VERTEX_SE3:QUAT {i} {x} {y} {z} 0 0 0 1"), "poses"),
    "Tecplot": (('VARIABLES = "Z","Y","X"\nZONE I=40, F=POINT', "{z} {y} {x}"), "Tecplot"),
    "TetGen": (("40 3 0 0", "{i} {x} {y} {z}"), "TetGen"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_tables_of_other_meaning_are_refused(tmp_path: Path, name: str) -> None:
    (header, form), words = REFUSED[name]
    content = table(header, form).replace(b"--", b"-")
    with pytest.raises(CloudFileError, match=words):
        read_points(write_file(tmp_path, content))


@pytest.mark.parametrize("least", [0, 1 << 60], ids=["kernel", "plain"])
def test_text_that_shifts_the_columns_of_later_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, least: int
) -> None:
    monkeypatch.setattr(text_table, "MIN_KERNEL_BYTES", least)
    form = "{word},{{i}},{{x}},{{y}},{{z}}"
    plain = table("name,id,x,y,z", form.format(word="street"))
    quoted = plain + table("", form.format(word='"Main street, 7"'))
    cloud = read_points(write_file(tmp_path, quoted))
    np.testing.assert_allclose(cloud.points[-40:], POINTS, rtol=0, atol=6e-4)
    bare = plain + table("", form.format(word="Main street, 7"))
    with pytest.raises(CloudFileError, match="line 42: more than 5 fields"):
        read_points(write_file(tmp_path, bare))


def test_blanks_in_the_labels_of_later_rows(tmp_path: Path) -> None:
    plain = table("", "P{i} {x} {y} {z}")
    words = plain + table("", "P{i} {x} {y} {z} an old tree")
    np.testing.assert_allclose(
        read_points(write_file(tmp_path, words)).points[-40:], POINTS, rtol=0, atol=6e-4
    )
    with pytest.raises(CloudFileError, match="line 41: more than 4 fields"):
        read_points(write_file(tmp_path, plain + table("", "P {i} {x} {y} {z}")))


def test_lists_at_the_end_of_rows_may_differ_in_length(tmp_path: Path) -> None:
    header = b"# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
    rows = b"".join(
        f"{i + 1} {x} {y} {z} 1 2 3 0.5 {'7 8 ' * (1 + i % 3)}\n".encode()
        for i, (x, y, z) in enumerate(ROWS)
    )
    for content in (header + rows, rows):
        cloud = read_points(write_file(tmp_path, content))
        np.testing.assert_allclose(cloud.points, POINTS, rtol=0, atol=6e-4)
