"""X and Y of surveyors: whichever comes first, east is x and north is y, so nothing is mirrored."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.formats import read_points
from tests.factories.decoding import write_file

EAST, NORTH, UP = np.random.default_rng(0).uniform(0, 500, (3, 20))
GRIDS = {
    "Gauss-Krueger, zone 3": (3_456_000, 5_678_000),
    "UTM": (612_000, 5_301_000),
    "UTM with its zone": (32_612_000, 5_301_000),
    "Gauss-Krueger of Austria": (-12_000, 5_340_000),
    "Krovak": (650_000, 1_050_000),
}


def read(tmp_path: Path, header: str, *columns: np.ndarray) -> tuple[np.ndarray, str]:
    rows = "".join(";".join(f"{value:.3f}" for value in row) + "\n" for row in np.stack(columns).T)
    cloud = read_points(write_file(tmp_path, f"{header}\n{rows}".encode()))
    return cloud.points, " ".join(cloud.warnings)


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("height", ["H", "Höhe", "Z [m]"])
def test_x_to_the_north_before_and_behind_y(tmp_path: Path, grid: str, height: str) -> None:
    east, north = GRIDS[grid]
    expected = np.stack([EAST + east, NORTH + north, UP], axis=1).round(3)
    points, warning = read(tmp_path, f"Y;X;{height}", *expected.T)
    np.testing.assert_array_equal(points, expected)
    assert f"'Y, X, {height}' 'Y' is read as east" in warning
    points, warning = read(tmp_path, f"X;Y;{height}", *expected.T[[1, 0, 2]])
    if height.startswith("Z"):  # also feet of America, where X is east: told, and left
        np.testing.assert_array_equal(points, expected[:, [1, 0, 2]])
        assert "'X' is read as east" in warning
    else:
        np.testing.assert_array_equal(points, expected)
        assert "'Y' is read as east" in warning


@pytest.mark.parametrize("grid", ["Gauss-Krueger, zone 3", "UTM", "UTM with its zone"])
def test_x_to_the_east(tmp_path: Path, grid: str) -> None:
    east, north = GRIDS[grid]
    expected = np.stack([EAST + east, NORTH + north, UP], axis=1).round(3)
    for height in ("H", "Z"):
        points, warning = read(tmp_path, f"X;Y;{height}", *expected.T)
        np.testing.assert_array_equal(points, expected)
        assert not warning
        points, warning = read(tmp_path, f"Y;X;{height}", *expected.T[[1, 0, 2]])
        np.testing.assert_array_equal(points, expected)
        assert "'X' is read as east" in warning


@pytest.mark.parametrize(
    "names",
    ["X坐标;Y坐标;高程", "X-Koordinate;Y-Koordinate;Höhe", "Koord. X;Koord. Y;H", "X[m];Y[m];H[m]"],
)
def test_letters_with_a_word(tmp_path: Path, names: str) -> None:
    expected = np.stack([EAST + 512_000, NORTH + 3_456_000, UP], axis=1).round(3)
    points, warning = read(tmp_path, names, *expected.T[[1, 0, 2]])
    np.testing.assert_array_equal(points, expected)
    assert "is read as east" in warning


def test_small_numbers_tell_nothing(tmp_path: Path) -> None:
    """The order of surveyors is right-handed; without their word for heights names count."""
    local = np.stack([EAST, NORTH, UP], axis=1).round(3)
    for header, axes in (("Nr;Y;X;H", (0, 1, 2)), ("Nr;y;x;z", (1, 0, 2)), ("Nr;X;Y;H", (0, 1, 2))):
        points, warning = read(tmp_path, header, np.arange(20), *local.T)
        np.testing.assert_array_equal(points, local[:, axes])
        assert ("is read as east" in warning) == ("X;Y" not in header)


def test_blanks_that_float_does_not_know(tmp_path: Path) -> None:
    """Found by fuzzing: a separator of records is a blank for str.strip, and not for float."""
    content = b"Nr;Y;X;H\n" + b"7;\x1e1.5;2.5;3.5\n" * 9
    np.testing.assert_array_equal(
        read_points(write_file(tmp_path, content)).points[0], [1.5, 2.5, 3.5]
    )
