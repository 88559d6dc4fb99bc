"""Rows of decimal numbers in text, at the speed of the memory."""

from __future__ import annotations

import numpy as np
from numba import njit, types

BLANKS = -1
"""Delimiter that stands for any run of blanks."""
UNCLEAR = -1
"""Returned where the text needs a slower reader that can report or repair it."""
_MAX_MANTISSA = 1 << 53
"""Largest whole number up to which float64 holds each."""
_MAX_POWER = 22
"""Largest power of ten that float64 holds exactly: one division rounds correctly."""
_POWERS = 10.0 ** np.arange(_MAX_POWER + 1)
_MAX_EXPONENT = 10_000
_BYTES = types.Array(types.uint8, 1, "C", readonly=True)


@njit(types.boolean(types.uint8, types.int64), cache=True, inline="always")
def _is_blank(byte, delimiter):
    return byte == 32 or byte == 13 or (byte == 9 and delimiter != 9)


@njit(types.boolean(types.uint8, types.int64), cache=True, inline="always")
def _ends_field(byte, delimiter):
    if byte == 10:
        return True
    if delimiter == BLANKS:
        return byte == 32 or byte == 9 or byte == 13
    return byte == delimiter


@njit(
    types.int64(_BYTES, types.int64, types.int64[::1], types.int64, types.float64[:, ::1]),
    cache=True,
)
def parse_rows(text, delimiter, targets, wanted, out):
    """Parse columns of the rows of a text; blank lines are skipped.

    Each number is rounded correctly, as Python's float() does: those with too many digits for
    that are unclear.

    Parameters
    ----------
    text : (B,) uint8
        The text.
    delimiter : int
        Byte between fields, or BLANKS.
    targets : (F,) int64
        Column of `out` for each field, -1 for fields that are not wanted.
    wanted : int
        Number of fields that are wanted.
    out : (N, K) float64
        Receives the numbers.

    Returns
    -------
    int
        Number of rows, at most N, or UNCLEAR: a field is missing or no plain number.
    """
    size, place, row = len(text), 0, 0
    while place < size and row < len(out):
        while place < size and _is_blank(text[place], delimiter):
            place += 1
        if place == size:
            break
        if text[place] == 10:
            place += 1
            continue
        found = 0
        for field in range(len(targets)):
            while place < size and _is_blank(text[place], delimiter):
                place += 1
            if targets[field] >= 0:
                negative = False
                if place < size and (text[place] == 45 or text[place] == 43):
                    negative = text[place] == 45
                    place += 1
                mantissa, digits, power, is_fraction = 0, 0, 0, False
                while place < size:
                    byte = text[place]
                    if 48 <= byte <= 57:
                        mantissa = 10 * mantissa + (byte - 48)
                        digits += 1
                        power -= is_fraction
                        if mantissa > _MAX_MANTISSA:
                            return UNCLEAR
                    elif byte == 46 and not is_fraction:
                        is_fraction = True
                    else:
                        break
                    place += 1
                if digits == 0:
                    return UNCLEAR
                if place < size and (text[place] == 101 or text[place] == 69):
                    place += 1
                    sign = 1
                    if place < size and (text[place] == 45 or text[place] == 43):
                        sign = -1 if text[place] == 45 else 1
                        place += 1
                    exponent, first = 0, place
                    while place < size and 48 <= text[place] <= 57:
                        exponent = 10 * exponent + (text[place] - 48)
                        if exponent > _MAX_EXPONENT:
                            return UNCLEAR
                        place += 1
                    if place == first:
                        return UNCLEAR
                    power += sign * exponent
                if power > _MAX_POWER or power < -_MAX_POWER:
                    return UNCLEAR
                value = float(mantissa)
                value = value * _POWERS[power] if power >= 0 else value / _POWERS[-power]
                out[row, targets[field]] = -value if negative else value
                found += 1
            else:
                while place < size and not _ends_field(text[place], delimiter):
                    if text[place] == 35 or text[place] == 34:
                        return UNCLEAR
                    place += 1
            if delimiter != BLANKS:
                while place < size and _is_blank(text[place], delimiter):
                    place += 1
            if place == size or text[place] == 10 or found == wanted:
                break
            if not _ends_field(text[place], delimiter):
                return UNCLEAR
            place += 1
        if found < wanted:
            return UNCLEAR
        if place < size and text[place] != 10 and not _ends_field(text[place], delimiter):
            return UNCLEAR
        while place < size and text[place] != 10:
            if text[place] == 13 and place + 1 < size and text[place + 1] != 10:
                return UNCLEAR
            place += 1
        place += 1
        row += 1
    return row
