"""Where a legacy VTK file holds points, cells and attributes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from service.formats.decoded_cloud import ReadLimits, check_count
from service.formats.errors import CloudFileError, MalformedFileError, UnsupportedFileError
from service.formats.vtk.cursor import Cursor

_MAX_HEADER_BYTES = 1 << 20
_MAX_METADATA_LINES = 1000
_DATASETS = (b"POLYDATA", b"UNSTRUCTURED_GRID", b"STRUCTURED_GRID")
_POINTS = re.compile(
    rb"^[ \t]*POINTS[ \t]+(\d{1,18})[ \t]+(\w{1,20})[ \t]*\r?\n", re.MULTILINE | re.IGNORECASE
)
_TYPES = {
    "float": ">f4", "double": ">f8", "int": ">i4", "short": ">i2", "char": "i1",
    "signed_char": "i1", "unsigned_char": "u1", "unsigned_short": ">u2", "unsigned_int": ">u4",
    "long": ">i8", "unsigned_long": ">u8", "vtkidtype": ">i4", "vtktypeint64": ">i8",
    "vtktypeuint64": ">u8",
}  # fmt: skip
CELLS = ("VERTICES", "LINES", "POLYGONS", "TRIANGLE_STRIPS", "CELLS")
_ONE_NUMBER = ("GLOBAL_IDS", "PEDIGREE_IDS", "EDGE_FLAGS")
_WIDTHS = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6}
"""Components of the attributes of fixed size."""
_FLOAT, _BYTE, _INT = (np.dtype(kind) for kind in (">f4", "u1", ">i4"))


@dataclass(frozen=True, slots=True)
class Column:
    """Numbers of all points or cells, and where they begin."""

    name: str
    kind: np.dtype[np.generic]
    width: int
    """Numbers of a row."""
    rows: int
    at: int
    """First byte."""


@dataclass(frozen=True, slots=True)
class CellLists:
    """Lists of corners: lengths and corners mixed, or (since version 5.1) ends and corners."""

    count: int
    """Cells, or ends: one more than cells."""
    numbers: Column
    """Numbers of the lists, or ends."""
    corners: Column | None


@dataclass(slots=True)
class Layout:
    """The parts of a file."""

    start: Cursor
    count: int
    """Points."""
    points: Column
    attributes: list[Column] = field(default_factory=list)
    cells: dict[str, CellLists] = field(default_factory=dict)
    """By keyword, as POLYGONS."""
    cell_types: Column | None = None
    warnings: tuple[str, ...] = ()


def read_layout(path: Path, limits: ReadLimits, *, is_whole: bool) -> Layout:
    """Find the points, and with `is_whole` what follows them.

    Raises
    ------
    CloudFileError
        The points are missing or not complete; what is damaged behind them is a warning.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_MAX_HEADER_BYTES)
    is_text = _check_header(head)
    found = _POINTS.search(head)
    kind = None if found is None else _TYPES.get(found[2].decode("latin1").lower())
    if found is None or kind is None:
        raise MalformedFileError("no line 'POINTS n type'; expected one with a type of numbers")
    count, dtype = int(found[1]), np.dtype(kind)
    row_bytes = 6 if is_text else 3 * dtype.itemsize
    check_count(count, row_bytes, size - found.end() + 1, "POINTS", limits)
    cursor = Cursor(path, size, found.end(), is_text)
    layout = Layout(cursor.copy(found.end()), count, Column("points", dtype, 3, count, found.end()))
    if is_whole:
        try:
            cursor.skip(3 * count, dtype)
            _find_sections(cursor, layout, limits)
        except CloudFileError as error:
            layout.warnings = (f"what follows is not kept: {error}",)
    return layout


def _check_header(head: bytes) -> bool:
    """Return whether the numbers are text."""
    lines = head.split(b"\n", 12)
    encoding = lines[2].strip().upper() if len(lines) > 2 else b""
    if encoding not in (b"ASCII", b"BINARY"):
        raise MalformedFileError(f"line 3: {encoding[:40]!r}; expected ASCII or BINARY")
    words = next((s.split() for s in lines[3:] if s.strip().upper().startswith(b"DATASET")), [])
    dataset = words[1].upper() if len(words) > 1 else b""
    if dataset not in _DATASETS:
        known = ", ".join(name.decode() for name in _DATASETS)
        raise UnsupportedFileError(
            f"DATASET {dataset[:40].decode('latin1')!r} has no list of points; expected one of "
            f"{known}: save it as poly data"
        )
    return encoding == b"ASCII"


def _find_sections(cursor: Cursor, layout: Layout, limits: ReadLimits) -> None:
    """Go through the sections behind the points."""
    is_of_points, rows = True, layout.count
    while words := cursor.words():
        keyword = words[0].upper()
        if keyword in CELLS:
            layout.cells[keyword] = _find_cells(cursor, words)
        elif keyword == "CELL_TYPES":
            layout.cell_types = _take(cursor, "types", _INT, 1, _number(words, 1))
        elif keyword in ("POINT_DATA", "CELL_DATA"):
            is_of_points, rows = keyword == "POINT_DATA", _number(words, 1)
            if is_of_points and rows != layout.count:
                raise MalformedFileError(f"POINT_DATA {rows}, but POINTS {layout.count}")
        elif keyword == "METADATA":
            _skip_metadata(cursor)
        else:
            for column in _find_columns(cursor, words, rows):
                if is_of_points and len(layout.attributes) < limits.max_properties:
                    layout.attributes.append(column)


def _find_columns(cursor: Cursor, words: list[str], rows: int) -> Iterator[Column]:
    """Yield the arrays of a section of attributes; those of a field have their own lengths."""
    keyword, name = words[0].upper(), unquote(words[1]) if len(words) > 1 else ""
    if keyword == "FIELD":
        yield from _find_field(cursor, _number(words, 2), rows)
    elif keyword == "SCALARS":
        width = _number(words, 3) if len(words) > 3 else 1
        at = cursor.at
        table = cursor.words()
        if table[:1] and table[0].upper() != "LOOKUP_TABLE":
            cursor.at = at
        yield _take(cursor, name, _type(words, 2), width, rows)
    elif keyword == "COLOR_SCALARS":
        kind = _FLOAT if cursor.is_text else _BYTE
        yield _take(cursor, "rgba", kind, _number(words, 2), rows)
    elif keyword == "LOOKUP_TABLE":
        cursor.skip(4 * _number(words, 2), _FLOAT if cursor.is_text else _BYTE)
    elif keyword == "TEXTURE_COORDINATES":
        yield _take(cursor, name, _type(words, 3), _number(words, 2), rows)
    elif keyword in _WIDTHS:
        kind = _type(words, 2)
        title = "Normals" if keyword == "NORMALS" else name
        yield _take(cursor, title, kind, _WIDTHS[keyword], rows)
    elif keyword in _ONE_NUMBER:
        yield _take(cursor, name, _type(words, 2), 1, rows)
    else:
        raise MalformedFileError(f"{words[0][:40]!r} begins no section of VTK")


def _find_field(cursor: Cursor, count: int, rows: int) -> Iterator[Column]:
    for _ in range(count):
        words = cursor.words()
        if words[:1] == ["METADATA"]:
            _skip_metadata(cursor)
            words = cursor.words()
        if not words:
            raise MalformedFileError("a field has fewer arrays than it announces")
        width, length = _number(words, 1), _number(words, 2)
        column = _take(cursor, unquote(words[0]), _type(words, 3), width, length)
        if length == rows:
            yield column


def _find_cells(cursor: Cursor, words: list[str]) -> CellLists:
    count, size = _number(words, 1), _number(words, 2)
    at = cursor.at
    following = cursor.words()
    if following[:1] != ["OFFSETS"]:
        cursor.at = at
        return CellLists(count, _take(cursor, "lists", _INT, 1, size), None)
    ends = _take(cursor, "ends", _type(following, 1), 1, count)
    following = cursor.words()
    if following[:1] != ["CONNECTIVITY"]:
        raise MalformedFileError(f"{words[0]}: OFFSETS without CONNECTIVITY")
    return CellLists(count, ends, _take(cursor, "corners", _type(following, 1), 1, size))


def _take(cursor: Cursor, name: str, kind: np.dtype[np.generic], width: int, rows: int) -> Column:
    at = cursor.at
    cursor.skip(width * rows, kind)
    return Column(name, kind, width, rows, at)


def _skip_metadata(cursor: Cursor) -> None:
    """Move behind lines that end with a blank one."""
    for _ in range(_MAX_METADATA_LINES):
        if not cursor.line():
            return
    raise MalformedFileError(f"METADATA of more than {_MAX_METADATA_LINES} lines")


def _number(words: list[str], place: int) -> int:
    if place >= len(words) or not words[place].isdecimal() or len(words[place]) > 18:
        raise MalformedFileError(f"{' '.join(words)[:80]!r} lacks a number at place {place}")
    return int(words[place])


def _type(words: list[str], place: int) -> np.dtype[np.generic]:
    name = words[place].lower() if place < len(words) else ""
    if name not in _TYPES:
        raise UnsupportedFileError(f"{' '.join(words)[:80]!r}: numbers of type {name[:40]!r}")
    return np.dtype(_TYPES[name])
