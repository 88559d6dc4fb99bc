"""Columns X and Y of surveyors, whose X points north: east comes first, against mirror images."""

from __future__ import annotations

import re
from collections.abc import Sequence

from service.formats.column_names import normalize_name
from service.formats.column_words import SURVEY
from service.formats.numerals import is_number

_LETTER = re.compile(
    r"(?:[ck]o[oö]rd\w*[\W_]+)?([xy])(?:[\W_]*(?:[ck]o[oö]rd\w*|wert|pos|座標|坐标|좌표))?"
)
"""X or Y, perhaps with a word for coordinates."""
_HEIGHTS = SURVEY[2] - {"z", "elevation", "elev", "height", "altitude", "alt", "up", "level"}
"""H and its words in other languages than English: names of surveyors, not of programmers."""
_MAX_EAST = 1e6
"""Eastings of maps are less, without the number of a zone before them; most northings are more."""
_MAX_NORTH = 1e7
"""Northings are less; eastings of zones with two digits are more."""
_ZONED_EAST, _ZONED_NORTH = (2e6, 4.8e6), (5.2e6, 6.2e6)
"""Eastings and northings of Gauss and Krueger in central Europe, zones 2 to 4 of three degrees."""


def with_east_first(
    names: Sequence[str], xyz: tuple[int, ...], fields: Sequence[str]
) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Return the columns of east, north and height, with a warning where that was in doubt.

    The sizes of the numbers decide over the order of the columns: names X, Y and H of the same
    grid mean the same in every file.

    Parameters
    ----------
    names, xyz
        Names of the columns, and those that are called x, y and z.
    fields
        The first row.

    Returns
    -------
    tuple[tuple[int, ...], tuple[str, ...]]
        The columns, and the warnings.
    """
    x, y, z = xyz
    letters = [_LETTER.fullmatch(normalize_name(names[place])) for place in (x, y)]
    if [found and found[1] for found in letters] != ["x", "y"]:
        return xyz, ()
    is_y_first, is_survey = y + 1 == x, normalize_name(names[z]) in _HEIGHTS
    X, Y = (_size(fields[place]) for place in (x, y))
    by_size = _are_east_north(Y, X)
    by_order = is_survey and is_y_first and not _are_east_north(X, Y)
    if not by_size and not is_y_first:
        return xyz, ()
    is_north = by_order or (by_size and (is_survey or is_y_first))
    found = (y, x, z) if is_north else xyz
    listed = ", ".join(_bare(names[place]) for place in sorted(xyz))
    east, north = (_bare(names[place]) for place in found[:2])
    return found, (
        f"of the columns {listed!r} {east!r} is read as east and {north!r} as north: "
        "name them E, N, H if that is wrong",
    )


def _are_east_north(east: float, north: float) -> bool:
    """Whether the sizes of two coordinates tell that they are east and north, in this order."""
    if east >= _MAX_NORTH > north or east < _MAX_EAST <= north < _MAX_NORTH:
        return True
    return all(
        low <= value < high for value, (low, high) in ((east, _ZONED_EAST), (north, _ZONED_NORTH))
    )


def _size(field: str) -> float:
    return abs(float(field.strip())) if is_number(field) else 0.0


def _bare(name: str) -> str:
    return name.strip(" \"'")[:40]
