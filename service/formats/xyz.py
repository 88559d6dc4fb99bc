"""Delimited text (XYZ, TXT, CSV, PTS): one point a line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.column_names import find_normals, find_xyz
from service.formats.decoded_cloud import DecodedCloud, ReadLimits
from service.formats.errors import (
    MalformedFileError,
    TruncatedFileError,
    UnsupportedFileError,
    missing_attribute,
)
from service.formats.text_table import Dialect, ends_with_newline, read_columns, read_head_lines

_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*|\s*[+-]?(nan|inf)\s*", re.I)
_DELIMITERS = (";", "\t", ",", None)  # None: any run of blanks
_COMMENTS = ("#", "//", "%")
_BYTE_ORDER_MARK = "\u00ef\u00bb\u00bf"  # UTF-8's, read as Latin-1


@dataclass(frozen=True, slots=True)
class _Layout:
    first_row: int  # index of the first line of data
    delimiter: str | None
    xyz: tuple[int, ...] = (0, 1, 2)
    normals: tuple[int, ...] | None = None
    others: dict[str, int] = field(default_factory=dict)  # named columns that begin with a number
    count: int | None = None  # announced in a line of its own
    decimal_comma: bool = False
    warnings: tuple[str, ...] = ()


def sniff(head: bytes) -> bool:
    """Whether the bytes are lines of numbers, after at most a few lines of header."""
    if b"\0" in head:
        return False
    lines = head.decode("latin1").split("\n")
    try:
        return _detect_layout(lines[:-1] if len(lines) > 1 else lines) is not None
    except MalformedFileError:
        return True  # the columns have other names: the reader reports them


def read(path: Path, limits: ReadLimits, weights: str | None = None) -> DecodedCloud:
    """Read the columns x, y, z (by name, else the first three), and named normals.

    `weights` names a column to keep as an attribute.

    Raises
    ------
    CloudFileError
        The text is malformed; the message names the line.
    """
    lines = read_head_lines(path, limits)
    if any("\0" in line for line in lines):
        raise UnsupportedFileError("the text has zero bytes; if it is UTF-16, save it as UTF-8")
    layout = _detect_layout(lines)
    if layout is None:
        raise MalformedFileError(
            f"line 1 to {len(lines)}: no line of three numbers; expected one point a line"
        )
    offset = sum(len(line) + 1 for line in lines[: layout.first_row])
    if layout.first_row == 0 and lines[0].startswith(_BYTE_ORDER_MARK):
        offset = len(_BYTE_ORDER_MARK)
    if weights is not None and weights not in layout.others:
        raise missing_attribute(weights, layout.others)
    columns = layout.xyz + (layout.normals or ())
    columns += () if weights is None else (layout.others[weights],)
    dialect = Dialect(layout.delimiter, decimal_comma=layout.decimal_comma)
    table = read_columns(path, offset, layout.first_row + 1, columns, limits, dialect=dialect)
    if layout.count is not None and len(table) < layout.count:
        raise TruncatedFileError(f"the file has {len(table)} rows, but announces {layout.count}")
    warnings = list(layout.warnings)
    if not ends_with_newline(path):
        warnings.append("the last line has no line end: its last number may have been cut")
    normals = table[:, 3:6] if layout.normals else None
    kept: dict[str, NDArray[np.generic]] = {} if weights is None else {weights: table[:, -1]}
    return DecodedCloud(table[:, :3], "xyz", tuple(warnings), normals, attributes=kept)


def _detect_layout(lines: Sequence[str]) -> _Layout | None:
    """Detect the layout with decimal points, else with decimal commas and ; or tabs."""
    layout = _find_layout(lines)
    if layout is None:
        layout = _find_layout([line.replace(",", ".") for line in lines])
        if layout is None or layout.delimiter not in (";", "\t"):
            return None
        warnings = (*layout.warnings, "commas are read as decimal points")
        layout = replace(layout, decimal_comma=True, warnings=warnings)
    return layout


def _find_layout(lines: Sequence[str]) -> _Layout | None:
    """Find the first line of data; the last line of text before it may name the columns."""
    header: str | None = None
    strays: list[int] = []
    count: int | None = None
    for index, raw in enumerate(lines):
        line = raw.removeprefix(_BYTE_ORDER_MARK).strip() if index == 0 else raw.strip()
        if not line:
            continue
        named = _named_layout(header, line, index) if header is not None else None
        if named is not None:
            return _complete(named, count, strays[:-1])
        delimiter, numeric = _numeric_delimiter(line)
        if numeric:
            _refuse_unclear(header, line, delimiter, index)
            return _complete(_Layout(index, delimiter), count, strays)
        if line.isdecimal() and count is None:
            count = int(line[:18])
        elif line.startswith(_COMMENTS):
            header = line.lstrip("#/%") if find_xyz(_split_any(line.lstrip("#/%"))) else header
        else:
            header = line
            strays.append(index + 1)
    return None


def _complete(layout: _Layout, count: int | None, strays: Sequence[int]) -> _Layout:
    warnings: tuple[str, ...] = ()
    if strays:
        warnings = (f"line {strays[0]} to {strays[-1]}: skipped as a header",)
    return replace(layout, count=count, warnings=warnings)


def _named_layout(header: str, line: str, index: int) -> _Layout | None:
    """Return columns by name, if the header has x, y, z and a name for each field."""
    for delimiter in _DELIMITERS:
        names, fields = _split(header, delimiter), _split(line, delimiter)
        xyz = find_xyz(names)
        if xyz and len(names) == len(fields) and all(_NUMBER.fullmatch(fields[i]) for i in xyz):
            bare = [name.strip().strip("\"'") for name in names]
            others = {
                name: place
                for place, name in enumerate(bare)
                if place not in xyz and bare.count(name) == 1 and _NUMBER.fullmatch(fields[place])
            }
            return _Layout(index, delimiter, xyz, find_normals(names), others)
    return None


def _refuse_unclear(header: str | None, line: str, delimiter: str | None, index: int) -> None:
    """Refuse a header with other names over more than three columns."""
    if header is None:
        return
    names, fields = _split(header, delimiter), _split(line, delimiter)
    if len(names) == len(fields) > 3 and not any(_NUMBER.fullmatch(name) for name in names):
        raise MalformedFileError(
            f"line {index}: the columns are called {', '.join(names)[:80]!r}; "
            "expected the names x, y and z among them"
        )


def _numeric_delimiter(line: str) -> tuple[str | None, bool]:
    for delimiter in _DELIMITERS:
        fields = _split(line, delimiter)
        if len(fields) >= 3 and all(_NUMBER.fullmatch(field) for field in fields[:3]):
            return delimiter, True
    return None, False


def _split(line: str, delimiter: str | None) -> list[str]:
    return line.strip().split(delimiter)


def _split_any(line: str) -> list[str]:
    return re.split(r"[;,\s]+", line.strip())
