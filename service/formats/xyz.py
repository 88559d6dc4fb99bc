"""Delimited text (XYZ, TXT, CSV, PTS): one point a line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits
from service.formats.errors import (
    CloudFileError,
    MalformedFileError,
    TruncatedFileError,
    UnsupportedFileError,
    missing_attribute,
)
from service.formats.numerals import is_number
from service.formats.text_layout import TextLayout, detect_layout
from service.formats.text_table import (
    Dialect,
    TableCleaner,
    ends_with_newline,
    read_columns,
    read_head_lines,
)
from service.formats.unnamed_columns import name_columns


def sniff(head: bytes) -> bool:
    """Whether the bytes are lines of numbers, after at most a few lines of header."""
    if b"\0" in head:
        return False
    lines = head.decode("latin1").split("\n")
    try:
        return detect_layout(lines[:-1] if len(lines) > 1 else lines) is not None
    except CloudFileError:
        return True  # the columns have other names: the reader reports them


def read(
    path: Path, limits: ReadLimits, weights: str | None = None, *, attributes: bool = False
) -> DecodedCloud:
    """Read the columns x, y, z (by name, else the first three), and named normals.

    `weights` names a column to keep as an attribute, `attributes` keeps all columns of numbers.

    Raises
    ------
    CloudFileError
        The text is malformed; the message names the line.
    """
    lines = read_head_lines(path, limits)
    if any("\0" in line for line in lines):
        raise UnsupportedFileError("the text has zero bytes; expected UTF-8 or UTF-16")
    layout = detect_layout(lines)
    if layout is None:
        raise MalformedFileError(
            f"line 1 to {len(lines)}: no line of three numbers; expected one point a line"
        )
    if weights is not None and weights not in layout.others:
        raise missing_attribute(weights, layout.others)
    columns = layout.xyz + (layout.normals or ())
    columns += () if weights is None else (layout.others[weights],)
    table, warnings = _read_table(path, lines, layout, columns, limits)
    if not ends_with_newline(path):
        warnings += ("the last line has no line end: its last number may have been cut",)
    normals = table[:, 3:6] if layout.normals else None
    kept: dict[str, NDArray[np.generic]] = {}
    if attributes:
        kept, more = _read_attributes(path, lines, layout, limits)
        warnings += more
    if weights is not None:
        kept[weights] = table[:, -1]
    return DecodedCloud(table[:, :3], "xyz", warnings, normals, attributes=kept)


def _read_attributes(
    path: Path, lines: list[str], layout: TextLayout, limits: ReadLimits
) -> tuple[dict[str, NDArray[np.generic]], tuple[str, ...]]:
    """Read the columns beside the coordinates, and warn of those that hold no numbers."""
    fields = lines[layout.first_row].strip().split(layout.delimiter)
    places = layout.others or {
        f"column_{place + 1}": place
        for place, word in enumerate(fields)
        if place not in layout.xyz and is_number(word.strip(' "').replace(",", "."))
    }
    lost = len(fields) - 3 - len(places)
    warnings = (f"{lost} columns without numbers are not kept",) if lost > 0 else ()
    if not places:
        return {}, warnings
    try:
        table, _ = _read_table(path, lines, layout, tuple(places.values()), limits)
    except CloudFileError as error:
        return {}, (f"the columns beside the coordinates are not kept: {error}",)
    if layout.others:
        return {name: _narrow(table[:, i]) for i, name in enumerate(places)}, warnings
    if layout.count is not None and table.shape[1] in (1, 4):  # PTS
        named = {"intensity": table[:, 0]} | name_columns(table[:, 1:], 5)
    else:
        named = name_columns(table, 4)
    return {name: _narrow(column) for name, column in named.items()}, warnings


def _narrow(column: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return whole numbers as int32, if all are."""
    if column.dtype != np.float64 or not np.isfinite(column).all():
        return column
    whole = column.astype(np.int64)
    fit = (whole == column).all() and (np.abs(column) < 2**31).all()
    return whole.astype(np.int32) if fit else column


def _read_table(
    path: Path, lines: list[str], layout: TextLayout, columns: tuple[int, ...], limits: ReadLimits
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    offset = sum(len(line) + 1 for line in lines[: layout.first_row])
    has_counts = layout.count is not None
    dialect = Dialect(layout.delimiter, decimal_comma=layout.decimal_comma, has_counts=has_counts)
    before = frozenset(line.strip() for line in lines[: layout.first_row]) - {""}
    cleaner = TableCleaner(dialect, columns, headers=before)
    table = read_columns(
        path, offset, layout.first_row + 1, columns, limits, dialect=dialect, cleaner=cleaner
    )
    announced = (layout.count or 0) + sum(cleaner.counts)
    if has_counts and len(table) < announced:
        raise TruncatedFileError(f"the file has {len(table)} rows, but announces {announced}")
    return table, tuple(dict.fromkeys(layout.warnings + cleaner.warnings()))
