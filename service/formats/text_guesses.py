"""What rows of numbers without names hold: counted rows, poses, matrices, labels of points."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from service.formats.errors import MalformedFileError, UnsupportedFileError
from service.formats.numerals import is_number, unquote

SAMPLED_ROWS = 20
"""Rows that are looked at."""
_AXES, _MIN_LONG_ROW = 3, 13
"""Rows of a table that is turned, and numbers in each: more than a line of a pose has."""
_MAX_UNNAMED = 64
"""Columns without names from which on the rows are those of a picture, or of a table."""
MIN_ROWS = 3
"""Rows that are no coincidence."""
_UNIT_TOL = 1e-3
"""Distance from a rotation up to which numbers are one; files round to four digits."""
_HALF_NUMBER = re.compile(r"0\d{1,16}|\d{3,17}[eE][+-]?\d{1,3}", re.ASCII)
"""What stands behind a decimal comma, and is no number of its own as programs write it."""

Rows = Sequence[Sequence[str]]


def sample_rows(lines: Sequence[str], delimiter: str | None) -> list[list[str]]:
    """Return the fields of the first lines, without blank ones."""
    texts = (unquote(line.strip()) for line in lines[: 2 * SAMPLED_ROWS])
    rows = [[item.strip() for item in text.split(delimiter)] for text in texts if text]
    return rows[:SAMPLED_ROWS]


def counts_rows(rows: Rows) -> bool:
    """Whether the first of more than three columns counts the rows, and the others do not."""
    if len(rows) < MIN_ROWS or any(len(row) < 4 or not is_count(row[0]) for row in rows):
        return False
    numbers = [int(row[0]) for row in rows]
    is_counted = all(after - before == 1 for before, after in pairwise(numbers))
    return is_counted and any("." in item for row in rows for item in row[1:4])


def refuse_long_rows(rows: Rows) -> None:
    """Refuse up to three rows of many numbers, and any of very many.

    Raises
    ------
    MalformedFileError
        The rows are axes, or all points in one line, or those of a picture.
    """
    longest = min((len(row) for row in rows), default=0)
    if 0 < len(rows) <= _AXES and longest >= _MIN_LONG_ROW:
        raise MalformedFileError(
            f"{len(rows)} rows of {len(rows[0])} numbers; expected a line for each point, with x, "
            "y and z: transpose the table"
        )
    if longest > _MAX_UNNAMED:
        raise MalformedFileError(
            f"rows of {longest} numbers without names, as of a depth image or a grid; expected a "
            "line for each point, with x, y and z"
        )


def refuse_poses(rows: Rows) -> None:
    """Refuse rows that are poses of a trajectory, or one matrix.

    Raises
    ------
    UnsupportedFileError
        The rows are poses of KITTI or TUM, or a homogeneous matrix.
    """
    width = len(rows[0]) if rows else 0
    if width not in (4, 8, 12) or any(len(row) != width for row in rows):
        return
    if not all(is_number(item) for row in rows for item in row):
        return
    numbers = np.array([[float(item) for item in row] for row in rows])
    if width == 4 and numbers.shape == (4, 4) and _are_rotations(numbers[:3, :3][None]):
        if (numbers[3] == (0, 0, 0, 1)).all():
            _refuse("a transformation matrix of four lines")
    elif width == 12 and _are_rotations(numbers.reshape(-1, 3, 4)[:, :, :3]):
        _refuse("poses of a trajectory, as in KITTI: rows of three lines of a matrix")
    elif width == 8 and _are_timed_poses(numbers):
        _refuse("poses of a trajectory, as in TUM's benchmark: time, place and quaternion")


def are_labelled(rows: Rows) -> bool:
    """Whether each row is a label and three or more numbers."""
    if len(rows) < MIN_ROWS or len(rows[0]) < 4:
        return False
    return all(
        len(row) == len(rows[0])
        and row[0] != ""
        and not is_number(row[0])
        and all(is_number(item) for item in row[1:4])
        for row in rows
    )


def has_decimal_commas(rows: Rows) -> bool:
    """Whether fields between commas are halves of numbers, as 083 and 128E+00 are."""
    fields = [item for row in rows for item in row]
    if any("." in item and is_number(item) for item in fields):
        return False
    return any(_HALF_NUMBER.fullmatch(item) is not None for item in fields)


def is_count(word: str) -> bool:
    """Whether a word is a whole number of few digits, without a sign."""
    return word.isascii() and word.isdecimal() and len(word) < 16


def _are_timed_poses(numbers: NDArray[np.float64]) -> bool:
    is_rising = len(numbers) >= MIN_ROWS and bool((np.diff(numbers[:, 0]) > 0).all())
    return is_rising and are_units(numbers[:, 4:])


def _are_rotations(matrices: NDArray[np.float64]) -> bool:
    products = matrices @ matrices.transpose(0, 2, 1)
    return bool(np.allclose(products, np.eye(3), rtol=0, atol=_UNIT_TOL))


def are_units(rows: NDArray[np.float64]) -> bool:
    """Whether all rows have length 1."""
    return bool(np.allclose(np.linalg.norm(rows, axis=1), 1, rtol=0, atol=_UNIT_TOL))


def _refuse(what: str) -> None:
    raise UnsupportedFileError(f"the rows are {what}, not points; send a cloud of points")
