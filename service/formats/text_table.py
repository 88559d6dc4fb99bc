"""Parser of columns of numbers in text, which reports the first faulty line."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    TooManyPointsError,
    TruncatedFileError,
)
from service.formats.memory_map import map_file
from service.formats.numerals import HASH_WORD, is_missing, is_number, unquote
from service.formats.text_encoding import decode_line, decode_lines

_CHUNK_BYTES = 1 << 20
_BLOCK_BYTES = 32 << 20
"""Bytes of a block of a file that is read in pieces."""
MIN_KERNEL_BYTES = 4 << 20
"""Bytes of text from which on the kernel is worth loading; it is ten times as fast."""
_COMMENT = re.compile(rf"(?<!\.)(?!{HASH_WORD})#")
"""Beginning of a comment; not the sign in 1.#QNAN, as Windows writes NaN, #N/A and colours."""
_HASH_VALUE = re.compile(rf"\.#|{HASH_WORD}".encode())
_HASH_VALUE_BYTES = 9
_END_OF_FILE = "\x1a"
"""Last character of texts of DOS."""


CUT_WARNING = "the last line has no line end: its last number may have been cut"


@dataclass(frozen=True, slots=True)
class Dialect:
    """How numbers are separated and written."""

    delimiter: str | None = None
    """Separator of the fields; None: any run of blanks."""
    keyword: str = ""
    """First word, column 0, of the lines to read; empty: all lines are read."""
    decimal_comma: bool = False
    """Whether commas are decimal points."""
    has_counts: bool = False
    """Whether a line of one whole number announces the rows that follow, as in PTS."""
    width: int = 0
    """Fields that a row has at most, where more of them hide which is which; 0: unbounded."""


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
        Rewrites unusual lines; used only where the plain parser fails, because it is slower. None:
        comments are removed and words for missing values are read.

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
    cleaner = cleaner or TableCleaner(dialect, columns, accepts_commas=False)
    block = TextBlock(path, offset, path.stat().st_size, first_line)
    table = read_block(block, columns, limits, rows=rows, dialect=dialect, cleaner=cleaner)
    if rows is not None and len(table) < rows:
        raise TruncatedFileError(f"the file ends after {len(table)} of {rows} announced rows")
    return table


@dataclass(frozen=True, slots=True)
class TextBlock:
    """Consecutive lines of a file."""

    path: Path
    start: int
    """First byte."""
    end: int
    """Byte after the last."""
    first_line: int
    """Number of the first line, for messages."""

    def content(self) -> NDArray[np.uint8]:
        """Return the bytes, mapped."""
        if self.start == self.end:
            return np.empty(0, np.uint8)
        return np.frombuffer(map_file(self.path, self.start, self.end - self.start), np.uint8)

    def lines(self) -> Iterator[str]:
        """Yield the lines with their ends."""
        left = self.end - self.start
        with self.path.open("rb") as file:
            file.seek(self.start)
            for line in file:
                if left <= 0:
                    return
                left -= len(line)
                yield decode_line(line)

    def chunks(self) -> Iterator[bytes]:
        """Yield the bytes, some at a time."""
        left = self.end - self.start
        with self.path.open("rb") as file:
            file.seek(self.start)
            while left > 0 and (chunk := file.read(min(_CHUNK_BYTES, left))):
                left -= len(chunk)
                yield chunk


def split_text(text: TextBlock, limits: ReadLimits) -> Iterator[TextBlock]:
    """Yield the text in blocks of whole lines.

    Raises
    ------
    FileLimitError
        A line is longer than the limit.
    """
    start, line = text.start, text.first_line
    while start < text.end:
        with text.path.open("rb") as file:
            file.seek(start + _BLOCK_BYTES)
            rest = file.readline(limits.max_line_bytes + 1)
        end = min(text.end, start + _BLOCK_BYTES + len(rest))
        block = TextBlock(text.path, start, end, line)
        yield block
        start, line = end, line + _count_lines(block, limits) - 1


def skip_lines(path: Path, offset: int, count: int) -> int:
    """Return the byte after this many lines, or the end of the file."""
    block = TextBlock(path, offset, path.stat().st_size, 1)
    for chunk in block.chunks():
        ends = np.flatnonzero(np.frombuffer(chunk, np.uint8) == ord("\n"))
        if len(ends) >= count:
            return offset + (int(ends[count - 1]) + 1 if count else 0)
        offset, count = offset + len(chunk), count - len(ends)
    return offset


def iter_columns(
    text: TextBlock,
    columns: Sequence[int],
    limits: ReadLimits,
    *,
    rows: int | None = None,
    dialect: Dialect = PLAIN,
) -> Iterator[NDArray[np.float64]]:
    """Parse as `read_columns` does, in consecutive pieces.

    Raises
    ------
    CloudFileError
        As `read_columns`.
    """
    cleaner = TableCleaner(dialect, columns, accepts_commas=False)
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
    count = _count_lines(block, limits)
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
    if (content == ord('"')).any():
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
    if is_small or dialect.keyword or dialect.decimal_comma or len({*columns}) < len(columns):
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
        lines = _normalize_lines(block.lines(), dialect)
        return np.loadtxt(
            lines if cleaner is None else cleaner.clean(lines),
            delimiter=dialect.delimiter if cleaner is None else ",",
            usecols=tuple(columns) if cleaner is None else None,
            max_rows=max_rows,
            comments=comments,
            ndmin=2,
        )


@dataclass(slots=True)
class TableCleaner:
    """Rewrites the wanted columns of lines whose meaning is clear although they are no numbers.

    Quotes are removed, missing values become NaN, decimal commas become points where commas do not
    separate the fields, and lines of counts are collected.
    """

    dialect: Dialect
    columns: Sequence[int]
    accepts_commas: bool = True
    """Whether numbers may have decimal commas."""
    counts: list[int] = field(default_factory=list)
    """Rows announced by lines of one whole number."""
    headers: frozenset[str] = frozenset()
    """Lines before the data; where they are repeated among the rows they are skipped."""
    repeated_headers: int = 0
    """Lines skipped as repetitions."""
    missing_rows: int = 0
    """Rows without any value."""
    has_points: bool = False
    """Whether a number has a decimal point."""
    has_commas: bool = False
    """Whether a number has a decimal comma."""

    def clean(self, lines: Iterable[str]) -> Iterator[str]:
        """Yield the wanted columns of each line, separated by commas.

        Raises
        ------
        MalformedFileError
            Some numbers have decimal points, and some have commas.
        """
        for line in lines:
            if self.headers and line.strip() in self.headers:
                self.repeated_headers += 1
                continue
            text = unquote(_COMMENT.split(line, maxsplit=1)[0].strip())
            if text in ("", _END_OF_FILE):
                continue
            if self.dialect.has_counts and text.isdecimal() and len(text) < 19:
                self.counts.append(int(text))
                continue
            fields = text.split(self.dialect.delimiter)
            if self._are_shifted(fields):
                yield "too many fields"
                continue
            if len(fields) <= max(self.columns) or "\r" in text:
                yield "too few fields"
                continue
            yield ",".join(self._clean_fields([fields[i].strip() for i in self.columns]))
            if self.has_points and self.has_commas:
                raise MalformedFileError(
                    f"{text[:60]!r}: some numbers have decimal points, and some have commas; "
                    "write all in the same way"
                )

    def _are_shifted(self, fields: Sequence[str]) -> bool:
        """Whether there are more fields than places; words at the end of a line do no harm."""
        width, delimiter = self.dialect.width, self.dialect.delimiter
        if not width or len(fields) - (not fields[-1]) <= width:
            return False
        return delimiter is not None or is_number(fields[-1])

    def _clean_fields(self, fields: list[str]) -> list[str]:
        if all(is_missing(item) for item in fields):
            self.missing_rows += 1
            return ["nan"] * len(fields)
        cleaned = ["nan" if item and is_missing(item) else item for item in fields]
        self.has_points |= any("." in item for item in cleaned)
        if not any("," in item for item in cleaned):
            return cleaned
        if not self.accepts_commas:
            return ["not a number" if "," in item else item for item in cleaned]
        self.has_commas = True
        return [item.replace(",", ".") for item in cleaned]

    def warnings(self) -> tuple[str, ...]:
        """Describe what was rewritten."""
        found = []
        if self.has_commas:
            found.append("commas are read as decimal points")
        if self.repeated_headers:
            found.append(f"{self.repeated_headers} lines that repeat the header are skipped")
        if self.missing_rows:
            found.append(f"{self.missing_rows} rows without values are read as NaN")
        return tuple(found)


def _normalize_lines(lines: Iterable[str], dialect: Dialect) -> Iterable[str]:
    """Yield the lines to read, with decimal points."""
    if dialect.keyword:
        starts = (f"{dialect.keyword} ", f"{dialect.keyword}\t")
        lines = (line for line in lines if line.lstrip(" \t").startswith(starts))
    if dialect.decimal_comma:
        lines = (line.replace(",", ".") for line in lines)
    return lines


def ends_with_newline(path: Path) -> bool:
    """Whether the last line has its line end; if not, its last number may have been cut."""
    with path.open("rb") as file:
        file.seek(-1, 2)
        return file.read(1) == b"\n"


def _has_hash_values(block: TextBlock) -> bool:
    """Whether the sign # is part of a value anywhere, as in 1.#QNAN and #N/A."""
    last = b""
    for chunk in block.chunks():
        if b"#" in chunk and _HASH_VALUE.search(last + chunk):
            return True
        last = chunk[-_HASH_VALUE_BYTES:]
    return False


def _count_lines(block: TextBlock, limits: ReadLimits) -> int:
    """Count the lines, of which the last may be empty, and check their lengths."""
    lines, length = 0, 0
    for chunk in block.chunks():
        ends = np.flatnonzero(np.frombuffer(chunk, np.uint8) == ord("\n"))
        gaps = np.diff(ends, prepend=-1 - length, append=len(chunk))
        if gaps.max() > limits.max_line_bytes:
            line = block.first_line + lines + int(np.argmax(gaps > limits.max_line_bytes))
            raise FileLimitError(
                f"line {line}: longer than {limits.max_line_bytes} bytes; "
                "expected text with one point a line"
            )
        lines += len(ends)
        length = len(chunk) - 1 - int(ends[-1]) if len(ends) else length + len(chunk)
    allowed = 2 * limits.max_points + limits.max_header_lines
    if lines > allowed:
        raise TooManyPointsError(f"the file has {lines} lines; the limit is {allowed}")
    return lines + 1


def _find_first_error(
    block: TextBlock, cleaner: TableCleaner, error: ValueError
) -> MalformedFileError:
    """Find the first line without a number in one of the columns."""
    dialect, columns = cleaner.dialect, cleaner.columns
    for number, raw in enumerate(block.lines(), block.first_line):
        line = next(iter(_normalize_lines([raw], dialect)), "")
        fields = _COMMENT.split(line, maxsplit=1)[0].strip().split(dialect.delimiter)
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


def read_head_lines(path: Path, limits: ReadLimits) -> list[str]:
    """Return the complete lines at the start of the file, up to the limits of a header."""
    with path.open("rb") as file:
        head = file.read(limits.max_header_bytes)
        complete = len(file.read(1)) == 0
    lines = decode_lines(head)
    return list(islice(lines if complete else lines[:-1], limits.max_header_lines))
