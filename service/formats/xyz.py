"""Delimited text (XYZ, TXT, CSV, PTS): one point a line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
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
from service.formats.mesh import off
from service.formats.numerals import is_number, significant_line, unquote
from service.formats.text_block import (
    CUT_WARNING,
    TextBlock,
    ends_with_newline,
    read_head_lines,
    skip_lines,
    split_text,
)
from service.formats.text_cleaner import Dialect, TableCleaner, unify_delimiters
from service.formats.text_detection import detect_layout
from service.formats.text_encoding import decode_lines
from service.formats.text_guesses import sample_rows
from service.formats.text_layout import TextLayout
from service.formats.text_table import read_block
from service.formats.unnamed_columns import name_columns

_NO_KEYWORD = "the text is read as OFF without its keyword: its rows are vertices and faces"


def sniff(head: bytes) -> bool:
    """Whether the bytes are lines of numbers, after at most a few lines of header."""
    if b"\0" in head:
        return False
    lines = decode_lines(head)
    try:
        return detect_layout(lines[:-1] if len(lines) > 1 else lines) is not None
    except CloudFileError:
        return True  # the columns have other names: the reader reports them


def read(
    path: Path,
    limits: ReadLimits,
    weights: str | None = None,
    *,
    attributes: bool = False,
    faces: bool = False,
) -> DecodedCloud:
    """Read the columns x, y, z (by name, else the first three), and named normals.

    `weights` names a column to keep as an attribute, `attributes` keeps all columns of numbers,
    `faces` those of an OFF file without its keyword.

    Raises
    ------
    CloudFileError
        The text is malformed; the message names the line.
    """
    text = _Text.open(path, limits, weights)
    cloud = text.read(text.block(path), limits, attributes=attributes)
    text.check_counts(len(cloud.points))
    if off.is_off_without_keyword(text.first_line(), len(cloud.points)):
        mesh = off.read(path, limits, attributes=attributes, faces=faces)
        return replace(mesh, warnings=(_NO_KEYWORD, *mesh.warnings))
    return replace(cloud, warnings=text.warnings(path) + cloud.warnings)


def read_pieces(
    path: Path,
    limits: ReadLimits,
    weights: str | None = None,
    *,
    attributes: bool = False,
    faces: bool = False,
) -> Iterator[DecodedCloud]:
    """Read as `read` does, in consecutive pieces, without faces."""
    text, rows = _Text.open(path, limits, weights), 0
    for block in split_text(text.block(path), limits):
        cloud = text.read(block, limits, attributes=attributes)
        rows += len(cloud.points)
        yield cloud
    text.check_counts(rows)
    yield DecodedCloud(np.empty((0, 3)), "xyz", text.warnings(path))


@dataclass(frozen=True, slots=True)
class _Text:
    """A table whose layout is known."""

    head: list[str]
    """Lines at the start of the file."""
    layout: TextLayout
    weights: str | None
    """Column to keep with the points."""
    cleaner: TableCleaner
    """What reads unusual lines of the coordinates, and knows what was unusual."""
    offset: int
    """Byte of the first row."""
    names: list[str] = field(default_factory=list)
    """Names of columns without names, as the first block tells them."""

    @classmethod
    def open(cls, path: Path, limits: ReadLimits, weights: str | None) -> _Text:
        """Find the layout by the first lines."""
        head = read_head_lines(path, limits)
        if any("\0" in line for line in head):
            raise UnsupportedFileError("the text has zero bytes; expected UTF-8 or UTF-16")
        layout = detect_layout(head)
        if layout is None:
            raise MalformedFileError(
                f"line 1 to {len(head)}: no line of three numbers; expected one point a line"
            )
        if layout.is_mixed:
            head = [unify_delimiters(line) for line in head]
        if weights is not None and weights not in layout.others:
            raise missing_attribute(weights, layout.others)
        columns = layout.xyz + (layout.normals or ())
        columns += () if weights is None else (layout.others[weights],)
        cleaner = _make_cleaner(head, layout, columns)
        offset = skip_lines(path, 0, layout.first_row)
        return cls(head, layout, weights, cleaner, offset)

    def block(self, path: Path) -> TextBlock:
        """Return the rows."""
        return TextBlock(path, self.offset, path.stat().st_size, self.layout.first_row + 1)

    def read(self, block: TextBlock, limits: ReadLimits, *, attributes: bool) -> DecodedCloud:
        """Read a block of the rows."""
        table = _read_rows(block, self.cleaner, limits)
        kept: dict[str, NDArray[np.generic]] = {}
        warnings: tuple[str, ...] = ()
        if attributes:
            kept, warnings = _read_attributes(block, self.head, self.layout, limits, self.names)
        if self.weights is not None:
            kept[self.weights] = table[:, -1]
        normals = table[:, 3:6] if self.layout.normals else None
        return DecodedCloud(table[:, :3], "xyz", warnings, normals, attributes=kept)

    def warnings(self, path: Path) -> tuple[str, ...]:
        """Describe what was unusual about the rows that were read."""
        warnings = tuple(dict.fromkeys(self.layout.warnings + self.cleaner.warnings()))
        if ends_with_newline(path):
            return warnings
        return (*warnings, CUT_WARNING)

    def first_line(self) -> str:
        """Return the first line that is neither blank nor a comment."""
        return significant_line("\n".join(self.head).encode()).decode()

    def check_counts(self, rows: int) -> None:
        """Check that there are as many rows as are announced, as in PTS."""
        announced = (self.layout.count or 0) + sum(self.cleaner.counts)
        if self.layout.count is not None and rows < announced:
            raise TruncatedFileError(f"the file has {rows} rows, but announces {announced}")


def _read_attributes(
    block: TextBlock, lines: list[str], layout: TextLayout, limits: ReadLimits, names: list[str]
) -> tuple[dict[str, NDArray[np.generic]], tuple[str, ...]]:
    """Read the columns beside the coordinates, and warn of those that hold no numbers."""
    fields = unquote(lines[layout.first_row].strip()).split(layout.delimiter)
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
        cleaner = _make_cleaner(lines, layout, tuple(places.values()))
        table = _read_rows(block, cleaner, limits)
    except CloudFileError as error:
        return {}, (f"the columns beside the coordinates are not kept: {error}",)
    if layout.others:
        return {name: _narrow(table[:, i]) for i, name in enumerate(places)}, warnings
    numbers = [place + 1 for place in places.values()]
    if layout.count is not None and table.shape[1] in (1, 4):  # PTS
        named = {"intensity": table[:, 0]} | name_columns(table[:, 1:], numbers[1:], names)
    else:
        named = name_columns(table, numbers, names)
    return {name: _narrow(column) for name, column in named.items()}, warnings


def _narrow(column: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return whole numbers as int32, if all are."""
    if column.dtype != np.float64 or not np.isfinite(column).all():
        return column
    whole = column.astype(np.int64)
    fit = (whole == column).all() and (np.abs(column) < 2**31).all()
    return whole.astype(np.int32) if fit else column


def _make_cleaner(lines: list[str], layout: TextLayout, columns: tuple[int, ...]) -> TableCleaner:
    has_counts = layout.count is not None
    fields = sample_rows(lines[layout.first_row :][:1], layout.delimiter)[0]
    last = max(layout.xyz)
    may_shift = last > 2 and not layout.is_open
    # between blanks, more columns behind the coordinates may be lists
    may_shift &= layout.delimiter is not None or len(fields) == last + 1
    dialect = Dialect(
        layout.delimiter,
        decimal_comma=layout.decimal_comma,
        is_mixed=layout.is_mixed,
        has_counts=has_counts,
        width=len(fields) if may_shift else 0,
    )
    before = frozenset(line.strip() for line in lines[: layout.first_row]) - {""}
    return TableCleaner(dialect, columns, headers=before)


def _read_rows(block: TextBlock, cleaner: TableCleaner, limits: ReadLimits) -> NDArray[np.float64]:
    return read_block(block, cleaner.columns, limits, dialect=cleaner.dialect, cleaner=cleaner)
