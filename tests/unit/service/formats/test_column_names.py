"""The columns of coordinates are found by their names, in any order and writing."""

from __future__ import annotations

import pytest

from service.formats.column_names import are_geographic, find_normals, find_xyz

PATTERNS = (
    *("{a}", "{A}", " {A} [m]", "{a}(mm)", "{a}/m", "{a} in mm", "{a}_(m)", "{a} {{m}}", "{a}<m>"),
    *("{A}-mm", "{A}mm", "{a}_meters", "{A} (US survey feet)", '"{A}"', "`{A}`", "'{a}'"),
    *("Pos{A}", "Point{A}", "coord{A}", "Position {A}", "{A}_Coordinate", "{a}val", "p_{a}"),
    *("p[{a}]", "Position[{A}] (m)", "pointcloud.{a}", "/scan/{a}", "Center {A}", "{a}_ecef"),
    *("{A}-Wert", "Koordinate {A}", "{a}_lidar", "Measured {A}", "coords{A}"),
    *("{A}:3", "{A}:10.3", "{a}:f4", "{a}:F8.3", "{a}:double", '"{A}: 3"'),
)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_names_of_axes(pattern: str) -> None:
    x, y, z = (pattern.format(a=axis, A=axis.upper()) for axis in "xyz")
    assert find_xyz([x, y, z, "i"]) == (0, 1, 2)
    assert find_xyz(["id", z, "i", x, y]) == (3, 4, 1)
    assert find_xyz([x, y, "i"]) is None
    assert find_xyz([x, y, z, x]) is None


@pytest.mark.parametrize(
    "names",
    [
        ("points:0", "points:1", "points:2"),
        ("xyz_1", "xyz_2", "xyz_3"),
        ("Location[0]", "Location[1]", "Location[2]"),
        ("E", "N", "U"),
        ("UTM Easting", "UTM Northing", "Ellipsoidal Height"),
    ],
)
def test_names_of_other_systems(names: tuple[str, ...]) -> None:
    assert find_xyz(["i", *names]) == (1, 2, 3)


def test_parts_of_normals_have_no_digits() -> None:
    names = ["Points:0", "Points:1", "Points:2", "Normals:0", "Normals:1", "Normals:2"]
    assert find_xyz(names) == (0, 1, 2)
    assert find_normals(names) == (3, 4, 5)


def test_directions_decide_over_the_letters() -> None:
    """East, north, up is right-handed; X to the north and Y to the east are a mirror image."""
    for x, y in (("X/Northing", "Y/Easting"), ("X (North)", "Y (East)"), ("x_norte", "y_este")):
        assert find_xyz([x, y, "H"]) == find_xyz([x, y, "Z"]) == (1, 0, 2)
        assert find_xyz([y, x, "H"]) == (0, 1, 2)


@pytest.mark.parametrize("pattern", ["acc.{a}", "n{a}", "{a}_std", "rot_{a}", "axis{A}", "v{a}"])
def test_other_vectors_are_no_places(pattern: str) -> None:
    names = [pattern.format(a=axis, A=axis.upper()) for axis in "xyz"]
    assert find_xyz(names) is None
    assert find_xyz([*names, "x", "y", "z"]) == (3, 4, 5)


def test_estimates_beside_the_coordinates() -> None:
    names = ["Label", "X/Easting", "Y/Northing", "Z/Altitude", "X_est", "Y_est", "Z_est"]
    assert find_xyz(names) == (1, 2, 3)


@pytest.mark.parametrize("names", ["lat lon alt", "X/Longitude Y/Latitude", "Lat(deg) Lng(deg) h"])
def test_degrees(names: str) -> None:
    assert are_geographic(names.split())
    assert not are_geographic(["lateral", "longitudinal", "z"])
