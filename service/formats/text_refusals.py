"""Refusal of text whose header and rows contradict each other, or that holds no points."""

from __future__ import annotations

import re
from collections.abc import Sequence

from service.formats.column_names import are_column_names, are_geographic
from service.formats.degrees import ADVICE
from service.formats.errors import MalformedFileError, UnsupportedFileError
from service.formats.numerals import is_number
from service.formats.text_header import Header, without_empty_end

_MAX_WORDS_OF_NAME = 3
_MAX_DEGREES = 360.0
_SYSTEM = re.compile(r"EPSG|GEOG|GEOD|PROJ|\+proj|CRS|WGS|degree", re.IGNORECASE)
_GEOGRAPHIC = re.compile(
    r"EPSG\W{0,3}(?:4326|4979|4258|4937|4269|4267|4152|4283|4939|4674|4490|4480|4612|6668|4617|4322"
    r"|4230|4314|4171|7844|7843|4167|4277|4313|4149|4150|4289|4312|4284|4301|6318|9000)\b"
    r"|GEOG(?:CS|CRS)\[|GEODCRS\[|\+proj=(?:longlat|latlong)|CRS84|\bgeographic coordinates",
    re.IGNORECASE,
)
"""Coordinate systems of longitude and latitude, by their codes in EPSG or their definitions."""
_PROJECTED = re.compile(
    r"EPSG\W{0,3}\d{4,5}|PROJ(?:CS|CRS)\[|\+proj=|UTM|GEOCCS\[|LOCAL_CS\[", re.IGNORECASE
)


def refuse_geographic(header: Header, delimiter: str | None, fields: Sequence[str]) -> None:
    """Refuse columns of latitude and longitude.

    Raises
    ------
    UnsupportedFileError
        The header names both.
    """
    for names in header.candidates(delimiter):
        if len(names.items) >= len(fields) and not names.xyz and are_geographic(names.items):
            raise UnsupportedFileError(
                f"line {header.number}: the columns {_readable(names.items)} are "
                "geographic coordinates in degrees; project latitude and longitude to metres, "
                "and name the columns x, y, z"
            )


def refuse_stated_degrees(lines: Sequence[str], fields: Sequence[str]) -> None:
    """Refuse rows below lines that state a coordinate system in degrees, and no other.

    Raises
    ------
    UnsupportedFileError
        The first two coordinates, `fields`, may be degrees.
    """
    text = "\n".join(line for line in lines if _SYSTEM.search(line))
    geographic = _GEOGRAPHIC.search(text)
    if geographic is None or _PROJECTED.search(_GEOGRAPHIC.sub("", text)):
        return
    if all(is_number(item) and abs(float(item)) <= _MAX_DEGREES for item in fields):
        raise UnsupportedFileError(
            f"{geographic[0][:40]!r} before the rows says that the coordinates are longitude and "
            f"latitude in degrees; expected lengths: {ADVICE}"
        )


def refuse_misplaced(header: Header, fields: Sequence[str], index: int) -> None:
    """Refuse names x, y, z that are not the first three, over another number of fields.

    Raises
    ------
    MalformedFileError
        Which columns they are is not known.
    """
    names = header.with_xyz()
    if names is not None and names.xyz != (0, 1, 2):
        raise _wrong_count(header, names.items, fields, index)


def refuse_other_names(
    header: Header, delimiter: str | None, fields: Sequence[str], index: int
) -> None:
    """Refuse a header with other names over more than three columns.

    Raises
    ------
    MalformedFileError
        None of the columns is called x, y or z.
    """
    if header.with_xyz():
        return
    names = without_empty_end(header.names[delimiter].items)
    if header.is_comment:
        names = next(
            (c.items for c in header.candidates(delimiter) if len(c.items) == len(fields)), []
        )
        if not are_column_names(names) and not _are_separate_words(header, delimiter, fields):
            return
    if any(map(is_number, names)):
        return
    if len(names) == len(fields):
        raise MalformedFileError(
            f"line {header.number}: the columns are called {_readable(names)}; "
            "expected the names x, y and z among them"
        )
    if delimiter is not None and len(names) > 1:
        raise _wrong_count(header, names, fields, index)


def _are_separate_words(header: Header, delimiter: str | None, fields: Sequence[str]) -> bool:
    """Whether a comment has as many short parts as the rows, between the same delimiters."""
    items = header.names[delimiter].items
    is_short = all(0 < len(item.split()) <= _MAX_WORDS_OF_NAME for item in items)
    return delimiter is not None and len(items) == len(fields) and is_short


def _wrong_count(
    header: Header, names: Sequence[str], fields: Sequence[str], index: int
) -> MalformedFileError:
    return MalformedFileError(
        f"line {header.number} names {len(names)} columns, but line {index + 1} has "
        f"{len(fields)} fields; expected a name for each column, and x, y and z among them"
    )


def _readable(names: Sequence[str]) -> str:
    """List names for a message."""
    return repr(", ".join(name.strip() for name in names)[:80])
