"""Parser of columns of numbers in text, which reports the first faulty line."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import (
    CloudFileError,
    MalformedFileError,
    TooManyPointsError,
    TruncatedFileError,
)
from service.formats.numerals import HASH_WORD, is_number
from service.formats.text_block import TextBlock, count_lines, split_text
from service.formats.text_cleaner import COMMENT, PLAIN, Dialect, TableCleaner, normalize_lines

MIN_KERNEL_BYTES = 4 << 20
"""Bytes of text from which on the kernel is worth loading; it is ten times as fast."""
_HASH_VALUE = re.compile(rf"\.#|{HASH_WORD}".encode())
_HASH_VALUE_BYTES = 9


def read_columns(
    path: Path,
    offset: int,
    first_line: int,
    columns: Sequence[int],
    limits: ReadLimits,
    *,
    rows: int | None = None,
    dialect: Dialect = PLAIN,
    cleaner: TableCleaner | None = None,
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
    cleaner
        Rewrites unusual lines, and knows what was unusual; used only where the plain parser fails,
        because it is slower.

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
    cleaner = cleaner or TableCleaner(dialect, columns)
    block = TextBlock(path, offset, path.stat().st_size, first_line)
    table = read_block(block, columns, limits, rows=rows, dialect=dialect, cleaner=cleaner)
    if rows is not None and len(table) < rows:
        raise TruncatedFileError(f"the file ends after {len(table)} of {rows} announced rows")
    return table


def iter_columns(
    text: TextBlock,
    columns: Sequence[int],
    limits: ReadLimits,
    *,
    rows: int | None = None,
    dialect: Dialect = PLAIN,
    cleaner: TableCleaner | None = None,
) -> Iterator[NDArray[np.float64]]:
    """Parse as `read_columns` does, in consecutive pieces.

    Raises
    ------
    CloudFileError
        As `read_columns`.
    """
    cleaner = cleaner or TableCleaner(dialect, columns)
    got = 0
    for block in split_text(text, limits):
        left = None if rows is None else rows - got
        if left == 0:
            return
        table = read_block(block, columns, limits, rows=left, dialect=dialect, cleaner=cleaner)
        got += len(table)
        yield table
    if rows is not None and got < rows:
        raise TruncatedFileError(f"the file ends after {got} of {rows} announced rows")


def read_block(
    block: TextBlock,
    columns: Sequence[int],
    limits: ReadLimits,
    *,
    rows: int | None = None,
    dialect: Dialect,
    cleaner: TableCleaner,
) -> NDArray[np.float64]:
    """Parse columns of at most `rows` rows; see `read_columns`."""
    count = count_lines(block, limits)
    max_rows = min(count, limits.max_points + 1 if rows is None else rows)
    try:
        if not _are_narrow(block, dialect):
            raise ValueError
        table = _parse_quickly(block, columns, max_rows, dialect)
        if table is None:
            table = _parse(block, columns, max_rows, dialect, None)
    except ValueError:
        try:
            table = _parse(block, columns, max_rows, dialect, cleaner)
        except CloudFileError:
            raise
        except ValueError as error:
            raise _find_first_error(block, replace(cleaner), error) from None
    table = table.reshape(-1, len(columns))
    if len(table) > limits.max_points:
        raise TooManyPointsError(f"the file has more than {limits.max_points} rows, the limit")
    return table


def _are_narrow(block: TextBlock, dialect: Dialect) -> bool:
    """Whether no row has a quoted field, or more fields than the width, if it is given."""
    if not dialect.width:
        return True
    content = block.content()
    if any((content == ord(quote)).any() for quote in "\"'"):
        return False
    is_end = content == ord("\n")
    if dialect.delimiter is None:
        is_blank = is_end | (content == ord(" ")) | (content == ord("\t")) | (content == ord("\r"))
        is_start = ~is_blank
        is_start[1:] &= is_blank[:-1]
        ends = np.cumsum(is_start)[is_end]
        counts = np.diff(ends, prepend=0, append=int(is_start.sum()))
        return bool((counts <= dialect.width).all())
    is_delimiter = content == ord(dialect.delimiter)
    lines = np.r_[np.flatnonzero(is_end), len(content)]
    before = np.r_[0, np.cumsum(is_delimiter)][lines]
    ends_so = is_delimiter[np.maximum(lines - 1, 0)] if len(content) else is_delimiter
    return bool((np.diff(before, prepend=0) + 1 - ends_so <= dialect.width).all())


def _parse_quickly(
    block: TextBlock, columns: Sequence[int], max_rows: int, dialect: Dialect
) -> NDArray[np.float64] | None:
    """Parse a large table of plain numbers by a kernel; None where that is not clear to it."""
    is_small = block.end - block.start < MIN_KERNEL_BYTES
    is_plain = not (dialect.keyword or dialect.decimal_comma or dialect.is_mixed)
    if is_small or not is_plain or len({*columns}) < len(columns):
        return None
    try:
        from mpe_core.kernels.decimal_rows import BLANKS, parse_rows
    except ModuleNotFoundError:
        return None
    delimiter = BLANKS if dialect.delimiter is None else ord(dialect.delimiter)
    targets = np.full(max(columns) + 1, -1)
    targets[list(columns)] = np.arange(len(columns))
    table = np.empty((max_rows, len(columns)))
    rows = parse_rows(block.content(), delimiter, targets, len(columns), table)
    return table[:rows] if rows >= 0 else None


def _parse(
    block: TextBlock,
    columns: Sequence[int],
    max_rows: int,
    dialect: Dialect,
    cleaner: TableCleaner | None,
) -> NDArray[np.float64]:
    # with 1.#QNAN or #N/A among the numbers only the cleaner can tell comments
    comments = None if cleaner or _has_hash_values(block) else "#"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # about blank lines and missing data
        lines = normalize_lines(block.lines(), dialect)
        return np.loadtxt(
            lines if cleaner is None else cleaner.clean(lines),
            delimiter=dialect.delimiter if cleaner is None else ",",
            usecols=tuple(columns) if cleaner is None else None,
            max_rows=max_rows,
            comments=comments,
            ndmin=2,
        )


def _has_hash_values(block: TextBlock) -> bool:
    """Whether the sign # is part of a value anywhere, as in 1.#QNAN and #N/A."""
    last = b""
    for chunk in block.chunks():
        if b"#" in chunk and _HASH_VALUE.search(last + chunk):
            return True
        last = chunk[-_HASH_VALUE_BYTES:]
    return False


def _find_first_error(
    block: TextBlock, cleaner: TableCleaner, error: ValueError
) -> MalformedFileError:
    """Find the first line without a number in one of the columns."""
    dialect, columns = cleaner.dialect, cleaner.columns
    for number, raw in enumerate(block.lines(), block.first_line):
        line = next(iter(normalize_lines([raw], dialect)), "")
        fields = COMMENT.split(line, maxsplit=1)[0].strip().split(dialect.delimiter)
        words = next(iter(cleaner.clean([line])), None)
        if words is None:
            continue
        if words == "too many fields":
            return MalformedFileError(
                f"line {number}: more than {dialect.width} fields, as many as the first row has; "
                "put text with delimiters into quotes"
            )
        if len(fields) <= max(columns):
            return MalformedFileError(
                f"line {number}: {len(fields)} fields; expected at least {max(columns) + 1}"
            )
        for column, word in zip(columns, words.split(","), strict=False):
            if not is_number(word) or "\r" in line.rstrip("\r\n"):
                return MalformedFileError(
                    f"line {number}: {fields[column].strip()[:40]!r} in column {column + 1} "
                    "is not a number"
                )
    return MalformedFileError(f"after line {block.first_line}: {error}")
