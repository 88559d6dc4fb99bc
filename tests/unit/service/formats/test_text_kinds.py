"""Tables of surveyors, spreadsheets and other programs: read rightly, or refused with a reason."""

from __future__ import annotations

import unicodedata
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
    "RiSCAN": (
        "# RiSCAN PRO ASCII export\n# X[m], Y[m], Z[m], Range[m], Amplitude[dB]",
        "{x},{y},{z},12.3,20.11",
    ),
    "Trimble": ("Point Number,N,E,Z,Description", '{i},{y},{x},{z},"MH, lid"'),
    "Ansys": ("[Name]\nPlane 1\n\n[Data]\nX [ m ], Y [ m ], Z [ m ], p [ Pa ]", "{x}, {y}, {z}, 1"),
    "STAR-CCM+": ('"Pressure (Pa)","X (m)","Y (m)","Z (m)"', "1.5,{x},{y},{z}"),
    "OxTS": ("Time (s),Pos X (m),Pos Y (m),Pos Z (m)", "{i},{x},{y},{z}"),
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
    "Hungarian": ("Pont;Kelet;Észak;Magasság", "{i};{x};{y};{z}"),
    "Turkish": ("Nokta No,Doğu,Kuzey,Yükseklik", "{i},{x},{y},{z}"),
    "Korean": ("번호,X좌표,Y좌표,표고", "{i},{x},{y},{z}"),
    "letters apart from their accents": (
        unicodedata.normalize("NFD", "Nr;Ost;Nord;Höhe"),
        "{i};{x};{y};{z}",
    ),
    "kinds of heights": (
        "Point Id\tEasting\tNorthing\tOrtho. Height\tCode",
        "P{i}\t{x}\t{y}\t{z}\ta tree",
    ),
    "Metashape": (
        '# CoordinateSystem: LOCAL_CS["m",UNIT["metre",1]]\n#Label,X/East,Y/North,Z/Altitude,X_est',
        "target {i},{x},{y},{z},7",
    ),
    "a message of ROS": (
        "%time,field.header.frame_id,field.point.x,field.point.y,field.point.z",
        "{i},base_link,{x},{y},{z}",
    ),
    "names of rows by R": ('"id" "X" "Y" "Z"', '"{i}" 7 {x} {y} {z}'),
    "words as names of rows": ('"id" "X" "Y" "Z"', '"tree {i}" 7 {x} {y} {z}'),
    "parts of a matrix": ("t,xyz_1,xyz_2,xyz_3,rgb_1,rgb_2,rgb_3", "{i},{x},{y},{z},1,2,3"),
    "bounds in comments": (
        "# scale factor x y z: 0.01 0.01 0.01\n# min x y z: -9.5 -9.5 -9.5",
        "{x} {y} {z} {i} 1 2 3",
    ),
    "marks of other comments": ("! made by hand\n! t X Y Z", "{i} {x} {y} {z}"),
    "units": ('"t";"X/mm";"Y/mm";"Z/mm"', "{i};{x};{y};{z}"),
    "words before the names": ("# scan 7\n# Format: t X Y Z", "{i} {x} {y} {z}"),
    "numbers before the names": ("# 1:t 2:x 3:y 4:z", "{i} {x} {y} {z}"),
    "colours as words": ("color,t,x,y,z", "#ff80{i:02},{i},{x},{y},{z}"),
    "east, north, up": ("id,E,N,U", "{i},{x},{y},{z}"),
    "an axis called north": ("id;X - North;Y - East;Z", "{i};{y};{x};{z}"),
    "axes with a direction": ("X (Northing),Y (Easting),Z,i", "{y},{x},{z},{i}"),
    "Chinese axes with a direction": ("点名,X(北),Y(东),H(高)", "{i},{y},{x},{z}"),
    "Arabic": ("نقطة,شرق,شمال,ارتفاع", "{i},{x},{y},{z}"),
    "Australian": ("Point,Easting (MGA),Northing (MGA),RL (AHD)", "{i},{x},{y},{z}"),
    "letters of a system": ("pt,E_MGA,N_MGA,RL", "{i},{x},{y},{z}"),
    "axes of a system": ("id;X_L93;Y_L93;Z_NGF", "{i};{x};{y};{z}"),
    "UTM and a datum": ("Punkt;UTM-E;UTM-N;Höhe ü. NHN", "{i};{x};{y};{z}"),
    "Dutch system": ("id;RD_X;RD_Y;NAP", "{i};{x};{y};{z}"),
    "axes with a number": ("id,x0,y0,z0", "{i},{x},{y},{z}"),
    "more coordinates": ("E,N,H,x,y,z", "1,2,3,{x},{y},{z}"),
    "single quotes": ("'a, b';'x';'y';'z'", "'P; {i}';'{x}';'{y}';'{z}'"),
    "apostrophes": ("name;x;y;z;owner", "farmer's;{x};{y};{z};miller's"),
    "two delimiters": ("", "{x}, {y} {z}"),
    "three delimiters": ("t x,y;z", "{i} {x},{y};{z}"),
    "another system": ("# GEOGCS of PROJCS: EPSG:32632", "{x} {y} {z}"),
    "seconds of UNIX": ("", "16000000{i:02}.25 {x} {y} {z} 7"),
    "colours before": ("", "255 {i} 0 {x} {y} {z}"),
    "numbers of points": ("", "10{i}7,{x},{y},{z},tree"),
}
LEADING = {
    "": None,
    "{i} ": "column 1 counts the rows; columns 2, 3 and 4",
    "7{i}3 ": "column 1 labels the points; columns 2, 3 and 4",
    "16000000{i:02}.5 ": "column 1 is taken for time; columns 2, 3 and 4",
    "9 8 {i} ": "columns 1 to 3 are taken for colours; columns 4, 5 and 6",
    "P{i} ": "column 1 labels the points; columns 2, 3 and 4",
}


@pytest.mark.parametrize("name", READ)
def test_tables_are_read(tmp_path: Path, name: str) -> None:
    cloud = read_points(write_file(tmp_path, table(*READ[name])))
    np.testing.assert_allclose(cloud.points, POINTS, rtol=0, atol=6e-4)


@pytest.mark.parametrize("leading", LEADING)
@pytest.mark.parametrize("is_comma", [False, True], ids=["points", "commas"])
def test_what_stands_before_the_coordinates_is_told(
    tmp_path: Path, leading: str, is_comma: bool
) -> None:
    content = table("", leading + "{x} {y} {z}")
    content = content.replace(b".", b",") if is_comma else content
    cloud = read_points(write_file(tmp_path, content), attributes=True)
    np.testing.assert_allclose(cloud.points, POINTS, rtol=0, atol=6e-4)
    told = " ".join(cloud.warnings)
    assert (LEADING[leading] or "") in told
    assert ("commas are read" in told) == is_comma
    assert ("northing" in told) == bool(leading), "northing before easting is a mirror image"


REFUSED = {
    "rows and columns": (("", "{i} 7 {x} {y} {z} 1 2 3"), "names the columns"),
    "brackets in a column": (("id;point", "{i};[{x}, {y}, {z}]"), "rows in brackets"),
    "other signs": (("", "{x}/{y}/{z}"), "signs of another kind"),
    "bounds": (("id;e_max;n_max;h", "{i};{x};{y};{z}"), "called 'id, e_max"),
    "2 columns": (("", "{x} {y}"), "rows of two numbers"),
    "touching": (("", "1.5-{x}-{y}-{z}"), "touch"),
    "thousands": (("E;N;H", "2'600'{i:03}.5;1'200'000.5;400.1"), "thousands"),
    "WKT": (("WKT,id", '"POINT Z ({x} {y} {z})",{i}'), "WKT"),
    "poses": (("", "VERTEX_SE3:QUAT {i} {x} {y} {z} 0 0 0 1"), "poses"),
    "Tecplot": (('VARIABLES = "Z","Y","X"\nZONE I=40, F=POINT', "{z} {y} {x}"), "Tecplot"),
    "degrees beside axes": (
        ("#Label,X/Longitude,Y/Latitude,Z/Altitude", "p{i},8.{i},47.{i},{z}"),
        "geographic",
    ),
    "labels under other names": (("name,a,b,c", "P{i},{x},{y},{z}"), "called 'name, a, b, c'"),
    "other names in a comment": (("# t, a, b, c", "{i}.5,{x},{y},{z}"), "called 't, a, b, c'"),
    "a turned table": (("1 " * 40 + "\n" + "2 " * 40 + "\n" + "3 " * 40, ""), "transpose"),
    "ARFF": (("@relation a\n@attribute t real\n@data", "{i},{x},{y},{z}"), "ARFF"),
    "GRASS": (("north: 9\nsouth: 0\neast: 9\nwest: 0\nrows: 40", "{x} {y} {z} 1"), "GRASS"),
    "Fortran": (("x,y,z", "{x}D+00,{y}D+00,{z}D+00"), "Fortran"),
    "two coordinates": (("x,y,intensity", "{x},{y},{z}"), "convert other coordinates"),
    "a turning scanner": (("#ANGLE, DISTANCE, QUALITY", "{x} {y} {z}"), "convert other"),
    "TetGen": (("40 3 0 0", "{i} {x} {y} {z}"), "TetGen"),
    "coordinates twice": (("x0,y0,z0,x1,y1,z1", "{x},{y},{z},{x},{y},{z}"), "called 'x0, y0"),
    "axes twice": (("E,N,H,pos_x,pos_y,pos_z", "{x},{y},{z},{x},{y},{z}"), "called 'E, N"),
    "classes before": (("", "2 {x} {y} {z}"), "classes.*names the columns"),
    "a clock before": (("", "{i}.5 {x} {y} {z}"), "as time does"),
    "a picture": (("", "{x} {y} {z} " * 30), "depth image"),
    "both decimals": (("", "1.5 {i},5 2,5"), "some have commas"),
    "EPSG": (("# EPSG:4326", "8.{i} 47.{i} 400"), "EPSG:4326.*degrees"),
    "EPSG under names": (("# CRS: WGS 84 (EPSG:4979)\nx,y,z", "8.{i},47.{i},400"), "degrees"),
    "a definition": (('// GEOGCS["WGS 84",DATUM["WGS_1984"]]', "8.{i} 47.{i} 400"), "degrees"),
    "PROJ": (("# +proj=longlat +datum=WGS84", "8.{i} 47.{i} 400"), "degrees"),
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


@pytest.mark.parametrize("word", ["#N/A", "#WERT!", "#DIV/0!"])
@pytest.mark.parametrize("row", ["{0};{0};{0};1", "1;{0};3;1"])
def test_errors_of_spreadsheets_are_nan(tmp_path: Path, word: str, row: str) -> None:
    content = table("x;y;z;i", "{x};{y};{z};{i}") + row.format(word).encode() + b"\n# end\n"
    cloud = read_points(write_file(tmp_path, content), attributes=True)
    np.testing.assert_allclose(cloud.points[:40], POINTS, rtol=0, atol=6e-4)
    assert len(cloud.points) == len(cloud.attributes["i"]) == 41
    assert np.isnan(cloud.points[40]).any()


def test_a_count_of_something_else_is_no_count_of_rows(tmp_path: Path) -> None:
    cloud = read_points(write_file(tmp_path, table("ore\n4\nAu\nX\nY\nZ", "{i} {x} {y} {z}")))
    assert any("column" in warning for warning in cloud.warnings), "no column is taken in silence"


def test_the_end_of_a_text_of_dos(tmp_path: Path) -> None:
    content = table("", "{x} {y} {z}") + b"\x1a"
    assert len(read_points(write_file(tmp_path, content)).points) == 40


def test_names_in_utf8_or_latin1(tmp_path: Path) -> None:
    text = table("x;y;z;Größe à;E", "{x};{y};{z};{i};0").decode()
    ply = (
        "ply\nformat ascii 1.0\nelement vertex 40\n"
        + "".join(f"property float {name}\n" for name in ("x", "y", "z", "Größe", "E"))
        + "end_header\n"
        + table("", "{x} {y} {z} {i} 0").decode()
    )
    pcd = (
        "FIELDS x y z Größe E\nSIZE 4 4 4 4 4\nTYPE F F F F F\nWIDTH 40\nHEIGHT 1\nDATA ascii\n"
        + table("", "{x} {y} {z} {i} 0").decode()
    )
    for content, name in ((text, "Größe à"), (ply, "Größe"), (pcd, "Größe")):
        for encoding in ("utf8", "latin1"):
            path = write_file(tmp_path, content.encode(encoding))
            cloud = read_points(path, attributes=True)
            np.testing.assert_array_equal(cloud.attributes[name], np.arange(40) + 1)


def test_letters_that_hold_the_byte_of_a_blank(tmp_path: Path) -> None:
    """À is C3 80 in UTF-8, Å C3 85 and à C3 A0: the latter two are blanks in Latin-1."""
    cloud = read_points(write_file(tmp_path, table("", "ÅÀà{i} {x} {y} {z}")))
    np.testing.assert_allclose(cloud.points, POINTS, rtol=0, atol=6e-4)


def test_lists_at_the_end_of_rows_may_differ_in_length(tmp_path: Path) -> None:
    header = b"# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
    rows = b"".join(
        f"{i + 1} {x} {y} {z} 1 2 3 0.5 {'7 8 ' * (1 + i % 3)}\n".encode()
        for i, (x, y, z) in enumerate(ROWS)
    )
    for content in (header + rows, rows):
        cloud = read_points(write_file(tmp_path, content))
        np.testing.assert_allclose(cloud.points, POINTS, rtol=0, atol=6e-4)


def test_names_of_colmap_have_no_commas(tmp_path: Path) -> None:
    content = table(
        "# POINT3D_ID, X, Y, Z, R, G, B, TRACK[] as (IMAGE_ID)", "{i} {x} {y} {z} 1 2 3 9"
    )
    found = read_points(write_file(tmp_path, content), attributes=True)
    assert list(found.attributes)[:4] == ["POINT3D_ID", "R", "G", "B"]


def test_numbers_of_returns_are_no_colours(tmp_path: Path) -> None:
    """As las2txt writes x, y, z, intensity, return, number of returns by default."""
    returns = read_points(write_file(tmp_path, table("", "{x} {y} {z} {i} 1 3")), attributes=True)
    assert list(returns.attributes) == ["column_4", "column_5", "column_6"]
    red = read_points(write_file(tmp_path, table("", "{x} {y} {z} {i} 0 3")), attributes=True)
    assert list(red.attributes) == ["red", "green", "blue"]
