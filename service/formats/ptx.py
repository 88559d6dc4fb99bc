"""Leica PTX files: gridded scans in ASCII, each with its pose in a common frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count, join_pieces
from service.formats.errors import FileLimitError, MalformedFileError
from service.formats.multi_scan import select_scans, to_viewpoints
from service.formats.numerals import is_number
from service.formats.text_block import TextBlock, skip_lines
from service.formats.text_cleaner import PLAIN, TableCleaner
from service.formats.text_table import iter_columns

_HEADER_LINES = 10
_COLUMNS = {4: ("intensity",), 7: ("intensity", "red", "green", "blue")}
"""Attributes by the number of fields in a row."""
_MAX_SCANS = 1000
_MAX_HEADER_BYTES = 4096
"""Bytes that the ten lines of a header may have."""


@dataclass(frozen=True, slots=True)
class _PtxHeader:
    """Ten lines: columns, rows, four of the scanner's pose, and four of the matrix."""

    count: int
    """Number of points: columns times rows."""
    matrix: NDArray[np.float64]
    """(4, 4), for row vectors."""
    size: int
    """Bytes of the header."""


@dataclass(frozen=True, slots=True)
class _Scan:
    """One of the scans of a file."""

    header: _PtxHeader
    offset: int
    """Byte of the first point."""
    line: int
    """Number of its line."""
    end: int
    """Byte after the last point."""
    fields: int
    """Numbers in a row."""


def _parse_header(head: bytes) -> _PtxHeader | None:
    """Parse the header at the start of the bytes; None if there is none."""
    lines = head[:_MAX_HEADER_BYTES].split(b"\n", _HEADER_LINES)
    if len(lines) <= _HEADER_LINES:
        return None
    rows = [line.decode("latin1").split() for line in lines[:_HEADER_LINES]]
    if [len(row) for row in rows] != [1, 1, 3, 3, 3, 3, 4, 4, 4, 4]:
        return None
    if not all(row[0].isdecimal() and len(row[0]) < 10 for row in rows[:2]):
        return None
    if not all(is_number(word) for row in rows[2:] for word in row):
        return None
    size = sum(len(line) + 1 for line in lines[:_HEADER_LINES])
    return _PtxHeader(int(rows[0][0]) * int(rows[1][0]), np.array(rows[6:], float), size)


def sniff(head: bytes) -> bool:
    """Whether the bytes begin with two counts, four lines of three and four of four numbers."""
    return _parse_header(head) is not None


def read(
    path: Path, limits: ReadLimits, scan: int | None, *, attributes: bool = False
) -> DecodedCloud:
    """Read a scan (counted from 0) or all scans, moved by their matrices.

    The matrices of the file multiply row vectors from the right. Points at (0, 0, 0) are missing
    returns and become NaN. `attributes` adds the intensity, and the colour where it is there.

    Raises
    ------
    CloudFileError
        The file is damaged or has no such scan; the message names the line.
    """
    return join_pieces(read_pieces(path, limits, scan, attributes=attributes))


def read_pieces(
    path: Path, limits: ReadLimits, scan: int | None, *, attributes: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read` does, in consecutive pieces; the last has no points, but the warnings."""
    scans = list(_find_scans(path, limits))
    wanted, warnings = select_scans(len(scans), scan)
    chosen = [scans[i] for i in wanted]
    names = _COLUMNS.get(min(item.fields for item in chosen), ()) if attributes else ()
    for item in chosen:
        columns = range(3 + len(names))
        count = item.header.count
        block = TextBlock(path, item.offset, item.end, item.line)
        cleaner = TableCleaner(PLAIN, columns)
        for table in iter_columns(block, columns, limits, rows=count, cleaner=cleaner):
            points = _transform(table[:, :3], item.header.matrix)
            kept = {name: _to_own_type(name, table[:, 3 + i]) for i, name in enumerate(names)}
            yield DecodedCloud(points, "ptx", attributes=kept)
        warnings += cleaner.warnings()
    viewpoints = to_viewpoints(item.header.matrix.T for item in chosen)
    warnings = tuple(dict.fromkeys(warnings))
    yield DecodedCloud(np.empty((0, 3)), "ptx", warnings, viewpoints=viewpoints)


def _find_scans(path: Path, limits: ReadLimits) -> Iterator[_Scan]:
    """Yield the scans of a file; only their headers are parsed."""
    offset, line, size, total, scans = 0, 1, path.stat().st_size, 0, 0
    while offset < size:
        with path.open("rb") as file:
            file.seek(offset)
            head = file.read(_MAX_HEADER_BYTES)
        if scans and not head.strip():
            break
        header = _parse_header(head)
        if header is None:
            raise MalformedFileError(
                f"line {line}: expected the ten lines of a PTX header (columns, rows, pose, matrix)"
            )
        if scans >= _MAX_SCANS:
            raise FileLimitError(f"line {line}: more than {_MAX_SCANS} scans")
        scans, total = scans + 1, total + header.count
        check_count(total, 0, 0, f"line {line}", limits)
        check_count(header.count, 6, size - offset, f"line {line}", limits)
        offset, line = offset + header.size, line + _HEADER_LINES
        end = skip_lines(path, offset, header.count)
        yield _Scan(header, offset, line, end, _count_fields(path, offset))
        offset, line = end, line + header.count


def _count_fields(path: Path, offset: int) -> int:
    """Count the fields of a row: x, y, z, intensity, and perhaps red, green, blue."""
    with path.open("rb") as file:
        file.seek(offset)
        return len(file.readline(_MAX_HEADER_BYTES).split())


def _to_own_type(name: str, column: NDArray[np.float64]) -> NDArray[np.generic]:
    if name == "intensity":
        return column.astype(np.float32)
    is_byte = bool(((column >= 0) & (column <= 255) & (column == np.rint(column))).all())
    return column.astype(np.uint8) if is_byte else column


def _transform(points: NDArray[np.float64], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    missing = ~points.any(axis=1)
    moved = points @ matrix[:3, :3] + matrix[3, :3]
    moved[missing] = np.nan
    return moved
