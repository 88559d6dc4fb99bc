"""Consecutive lines of a file of text, read some at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import FileLimitError, TooManyPointsError
from service.formats.memory_map import map_file
from service.formats.text_encoding import decode_line, decode_lines

_CHUNK_BYTES = 1 << 20
_BLOCK_BYTES = 32 << 20
"""Bytes of a block of a file that is read in pieces."""
CUT_WARNING = "the last line has no line end: its last number may have been cut"


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
        start, line = end, line + count_lines(block, limits) - 1


def skip_lines(path: Path, offset: int, count: int) -> int:
    """Return the byte after this many lines, or the end of the file."""
    block = TextBlock(path, offset, path.stat().st_size, 1)
    for chunk in block.chunks():
        ends = np.flatnonzero(np.frombuffer(chunk, np.uint8) == ord("\n"))
        if len(ends) >= count:
            return offset + (int(ends[count - 1]) + 1 if count else 0)
        offset, count = offset + len(chunk), count - len(ends)
    return offset


def count_lines(block: TextBlock, limits: ReadLimits) -> int:
    """Count the lines, of which the last may be empty, and check their lengths."""
    lines, is_doubtful = 0, False
    for chunk in block.chunks():
        lines += int(np.count_nonzero(np.frombuffer(chunk, np.uint8) == ord("\n")))
        is_doubtful |= not _has_short_lines(chunk, limits.max_line_bytes // 2)
    if is_doubtful:
        _check_line_lengths(block, limits)
    allowed = 2 * limits.max_points + limits.max_header_lines
    if lines > allowed:
        raise TooManyPointsError(f"the file has {lines} lines; the limit is {allowed}")
    return lines + 1


def _has_short_lines(chunk: bytes, length: int) -> bool:
    """Whether each part of this length has a line end, so that no line is twice as long."""
    starts = range(0, len(chunk), length)
    return all(chunk.find(b"\n", start, start + length) >= 0 for start in starts)


def _check_line_lengths(block: TextBlock, limits: ReadLimits) -> None:
    """Check the length of each line.

    Raises
    ------
    FileLimitError
        A line is longer than the limit.
    """
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


def read_head_lines(path: Path, limits: ReadLimits) -> list[str]:
    """Return the complete lines at the start of the file, up to the limits of a header."""
    with path.open("rb") as file:
        head = file.read(limits.max_header_bytes)
        complete = len(file.read(1)) == 0
    lines = decode_lines(head)
    return list(islice(lines if complete else lines[:-1], limits.max_header_lines))


def ends_with_newline(path: Path) -> bool:
    """Whether the last line has its line end; if not, its last number may have been cut."""
    with path.open("rb") as file:
        file.seek(-1, 2)
        return file.read(1) == b"\n"
