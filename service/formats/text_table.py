"""Parser of columns of numbers in text, which reports the first faulty line."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import FileLimitError, MalformedFileError, TruncatedFileError

_BLOCK_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class Dialect:
    """How numbers are separated and written."""

    delimiter: str | None = None
    """Separator of the fields; None: any run of blanks."""
    keyword: str = ""
    """First word, column 0, of the lines to read; empty: all lines are read."""
    decimal_comma: bool = False
    """Whether commas are decimal points."""


PLAIN = Dialect()
"""Numbers between blanks."""


def read_columns(
    path: Path,
    offset: int,
    first_line: int,
    columns: Sequence[int],
    limits: ReadLimits,
    *,
    rows: int | None = None,
    dialect: Dialect = PLAIN,
) -> NDArray[np.float64]:
    """Parse columns of numbers; blank lines and comments (#) are skipped.

    Parameters
    ----------
    path
        The file.
    offset
        Byte at which the table begins.
    first_line
        Number of the line at `offset`, for messages.
    columns
        Indices of the columns to read.
    limits
        Bounds on points and on the length of a line.
    rows
        Number of rows to read; None for all.
    dialect
        How the numbers are written.

    Returns
    -------
    NDArray[np.float64]
        (rows, len(columns)).

    Raises
    ------
    MalformedFileError
        A field is missing or not a number; the message names the line.
    TruncatedFileError
        The file has fewer rows than requested.
    FileLimitError
        A line is too long, or there are too many.
    """
    lines = _count_lines(path, offset, first_line, limits)
    with path.open(encoding="latin1", newline="\n") as file, warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", UserWarning
        )  # about blank lines and missing data: checked below
        file.seek(offset)
        try:
            table = np.loadtxt(
                _normalize_lines(file, dialect),
                delimiter=dialect.delimiter,
                usecols=tuple(columns),
                max_rows=min(lines, limits.max_points + 1 if rows is None else rows),
                comments="#",
                ndmin=2,
            )
        except ValueError as error:
            raise _find_first_error(path, offset, first_line, columns, dialect, error) from None
    table = table.reshape(-1, len(columns))
    if len(table) > limits.max_points:
        raise FileLimitError(f"the file has more than {limits.max_points} rows, the limit")
    if rows is not None and len(table) < rows:
        raise TruncatedFileError(f"the file ends after {len(table)} of {rows} announced rows")
    return table


def _normalize_lines(lines: Iterable[str], dialect: Dialect) -> Iterable[str]:
    """Yield the lines to read, with decimal points."""
    if dialect.keyword:
        starts = (f"{dialect.keyword} ", f"{dialect.keyword}\t")
        lines = (line for line in lines if line.startswith(starts))
    if dialect.decimal_comma:
        lines = (line.replace(",", ".") for line in lines)
    return lines


def ends_with_newline(path: Path) -> bool:
    """Whether the last line has its line end; if not, its last number may have been cut."""
    with path.open("rb") as file:
        file.seek(-1, 2)
        return file.read(1) == b"\n"


def _count_lines(path: Path, offset: int, first_line: int, limits: ReadLimits) -> int:
    lines, length = 0, 0
    with path.open("rb") as file:
        file.seek(offset)
        while chunk := file.read(_BLOCK_BYTES):
            ends = np.flatnonzero(np.frombuffer(chunk, np.uint8) == ord("\n"))
            gaps = np.diff(ends, prepend=-1 - length, append=len(chunk))
            if gaps.max() > limits.max_line_bytes:
                line = first_line + lines + int(np.argmax(gaps > limits.max_line_bytes))
                raise FileLimitError(
                    f"line {line}: longer than {limits.max_line_bytes} bytes; "
                    "expected text with one point a line"
                )
            lines += len(ends)
            length = len(chunk) - 1 - int(ends[-1]) if len(ends) else length + len(chunk)
    allowed = 2 * limits.max_points + limits.max_header_lines
    if lines > allowed:
        raise FileLimitError(f"the file has {lines} lines; the limit is {allowed}")
    return lines + 1


def _find_first_error(
    path: Path,
    offset: int,
    first_line: int,
    columns: Sequence[int],
    dialect: Dialect,
    error: ValueError,
) -> MalformedFileError:
    """Find the first line without a number in one of the columns."""
    with path.open("rb") as file:
        file.seek(offset)
        for number, raw in enumerate(file, first_line):
            line = raw.decode("latin1")
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            if not list(_normalize_lines([line], dialect)):
                continue
            fields = line.split("#")[0].strip().split(dialect.delimiter)
            if len(fields) <= max(columns):
                return MalformedFileError(
                    f"line {number}: {len(fields)} fields; expected at least {max(columns) + 1}"
                )
            for column in columns:
                field = fields[column]
                point = field.replace(",", ".") if dialect.decimal_comma else field
                if not _is_number(point) or "\r" in line.rstrip("\r\n"):
                    return MalformedFileError(
                        f"line {number}: {field[:40].strip()!r} in column {column + 1} "
                        "is not a number"
                    )
    return MalformedFileError(f"after line {first_line}: {error}")


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return "_" not in field


def read_head_lines(path: Path, limits: ReadLimits) -> list[str]:
    """Return the complete lines at the start of the file, up to the limits of a header."""
    with path.open("rb") as file:
        head = file.read(limits.max_header_bytes)
        complete = len(file.read(1)) == 0
    lines = head.decode("latin1").split("\n")
    return list(islice(lines if complete else lines[:-1], limits.max_header_lines))
