"""What stands before the coordinates in rows without names: counts, labels, time, colours."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from service.formats.errors import MalformedFileError
from service.formats.numerals import is_number
from service.formats.text_guesses import MIN_ROWS, Rows, are_units, counts_rows, is_count

_MIN_TIME = 1e8
"""Least seconds of UNIX or GPS in use; coordinates of maps, with the zone before them, are less."""
_MIN_EVEN_ROWS = 5
_EVEN_TOL = 1e-3
"""Share of a step by which steps of time may differ; files round to some digits."""
_MAX_COLOR = 255
_NAME_THEM = "expected a first line that names the columns, as 'row col x y z' or 't x y z'"
_MAYBE_NORTHING = "name them if they are northing and easting"


def find_leading(rows: Rows) -> tuple[int, str] | None:
    """Return how many columns stand before the coordinates, and what they are; None if none do.

    Raises
    ------
    MalformedFileError
        Something stands before the coordinates, or may, but it is not clear what.
    """
    is_wide = len(rows) >= MIN_ROWS and all(len(row) >= 4 for row in rows)
    whole = _count_whole(rows) if is_wide else 0
    is_followed = whole > 0 and _are_decimal(rows, whole) and not _are_normals(rows, whole)
    if is_followed and whole > 1:
        return whole, _describe_whole(rows, whole)
    is_coordinates = whole >= 3 and _are_normals(rows, whole)
    if counts_rows(rows) and not is_coordinates:
        return 1, "counts the rows"
    if is_followed:
        return 1, _describe_whole(rows, 1)
    numbers = _to_numbers(rows) if is_wide else None
    if numbers is None:
        return None
    _refuse_even(numbers, len(rows[0]))
    time, others = np.abs(numbers[:, 0]), np.abs(numbers[:, 1:])
    return (1, "is taken for time") if time.min() >= _MIN_TIME > others.max() else None


def _refuse_even(numbers: NDArray[np.float64], width: int) -> None:
    """Refuse a first column that rises evenly beside others that do not.

    Raises
    ------
    MalformedFileError
        It may be time, or a coordinate along a track.
    """
    is_time = len(numbers) >= _MIN_EVEN_ROWS and abs(numbers[0, 0]) < _MIN_TIME
    if not is_time or not _rises_evenly(numbers[:, 0]):
        return
    if any(_rises_evenly(numbers[:, i]) or np.ptp(numbers[:, i]) == 0 for i in (1, 2, 3)):
        return
    raise MalformedFileError(
        f"column 1 of {width} rises evenly, as time does, and columns 2 to 4 do not; {_NAME_THEM}"
    )


def describe_leading(leading: int, what: str, width: int) -> str:
    """Say which columns are read behind the first ones."""
    first = "column 1" if leading == 1 else f"columns 1 to {leading}"
    x, y, z = range(leading + 1, leading + 4)
    return (
        f"{first} {what}; columns {x}, {y} and {z} of {width} are read as x, y, z: "
        f"{_MAYBE_NORTHING}"
    )


def _describe_whole(rows: Rows, whole: int) -> str:
    """Say what whole numbers before decimal ones are.

    Raises
    ------
    MalformedFileError
        It is not clear.
    """
    if whole == 1 and len({row[0] for row in rows}) == len(rows):
        return "labels the points"
    leading = [int(item) for row in rows for item in row[:whole]]
    if whole == 3 and 1 < max(leading) <= _MAX_COLOR and min(leading) >= 0:
        return "are taken for colours"
    first = "column 1 has" if whole == 1 else f"columns 1 to {whole} have"
    raise MalformedFileError(
        f"{first} whole numbers, as rows and columns of a scan or classes, and columns "
        f"{whole + 1} to {whole + 3} have not; {_NAME_THEM}"
    )


def _count_whole(rows: Rows) -> int:
    """Count the first columns that have whole numbers in all rows."""
    width = min(len(row) for row in rows)
    is_whole = [all(is_count(row[place].lstrip("-")) for row in rows) for place in range(width)]
    return is_whole.index(False) if False in is_whole else 0


def _are_decimal(rows: Rows, first: int) -> bool:
    parts = [row[first : first + 3] for row in rows]
    return all(len(part) == 3 and all("." in item for item in part) for part in parts)


def _are_normals(rows: Rows, first: int) -> bool:
    """Whether decimal numbers are unit vectors, so that whole ones before may be coordinates."""
    parts = [row[first : first + 3] for row in rows]
    if not all(is_number(item) for part in parts for item in part):
        return False
    return are_units(np.array([[float(item) for item in part] for part in parts]))


def _to_numbers(rows: Rows) -> NDArray[np.float64] | None:
    first: list[Sequence[str]] = [row[:4] for row in rows]
    if not all(is_number(item) for row in first for item in row):
        return None
    return np.array([[float(item) for item in row] for row in first])


def _rises_evenly(column: NDArray[np.float64]) -> bool:
    steps = np.array([after - before for before, after in pairwise(column)])
    return bool((steps > 0).all() and np.ptp(steps) <= _EVEN_TOL * steps.mean())
