"""A place in a legacy VTK file, from which lines and numbers are read one after the other."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.column_types import restore_type
from service.formats.errors import MalformedFileError, TruncatedFileError
from service.formats.memory_map import map_file
from service.formats.text_encoding import decode_line

_BLOCK_BYTES = 1 << 22
_MAX_LINE_BYTES = 1 << 16
_LAST_CHARACTERS = 64
"""Characters kept between blocks of text, in which the last number may be cut."""
_MAX_EMPTY_LINES = 1000
_WORD = re.compile(rb"\S+")


@dataclass(slots=True)
class Cursor:
    """A place in a file; reading moves it on."""

    path: Path
    size: int
    """Bytes of the file."""
    at: int
    """Next byte."""
    is_text: bool

    def copy(self, at: int) -> Cursor:
        """Return another cursor in the same file."""
        return Cursor(self.path, self.size, at, self.is_text)

    def line(self) -> bytes:
        """Return the next line without its end; empty at the end of the file, too."""
        with self.path.open("rb") as file:
            file.seek(self.at)
            text = file.readline(_MAX_LINE_BYTES)
        self.at += len(text)
        return text.strip()

    def words(self) -> list[str]:
        """Return the words of the next line that is not blank; none at the end of the file."""
        for _ in range(_MAX_EMPTY_LINES):
            words = decode_line(self.line()).split()
            if words or self.at >= self.size:
                return words
        return []

    def rows(self, count: int, width: int, kind: np.dtype[np.generic]) -> NDArray[np.generic]:
        """Return the next numbers (count, width) in the native form of their type.

        Raises
        ------
        TruncatedFileError
            The file ends before.
        """
        self._check_size(count * width, kind)
        if not self.is_text:
            size = count * width * kind.itemsize
            content = map_file(self.path, self.at, size) if size else b""
            self.at += size
            numbers = np.frombuffer(content, kind).astype(kind.newbyteorder("="))
        else:
            parse = np.float64 if kind.kind == "f" else np.int64
            parts = [_to_numbers(words, parse) for words in self._iter_words(count * width)]
            numbers = np.concatenate(parts) if parts else np.empty(0, parse)
            numbers = restore_type(numbers, kind.str[1:])
        return numbers.reshape(count, width)

    def skip(self, count: int, kind: np.dtype[np.generic]) -> None:
        """Move beyond so many numbers.

        Raises
        ------
        TruncatedFileError
            The file ends before.
        """
        self._check_size(count, kind)
        if not self.is_text:
            self.at += count * kind.itemsize
            return
        for _ in self._iter_words(count):
            pass

    def _check_size(self, count: int, kind: np.dtype[np.generic]) -> None:
        needed = 2 * count - 1 if self.is_text else count * kind.itemsize
        if needed > self.size - self.at:
            raise TruncatedFileError(
                f"byte {self.at}: {count} numbers are announced, but only {self.size - self.at} "
                "bytes follow; is the file complete?"
            )

    def _iter_words(self, count: int) -> Iterator[list[bytes]]:
        """Yield so many words between blanks, whatever their number in a line."""
        left, rest = count, b""
        with self.path.open("rb") as file:
            file.seek(self.at)
            while left > 0:
                block = file.read(_BLOCK_BYTES)
                text = rest + block
                words = text.split()
                is_cut = bool(block and words) and not block[-1:].isspace()
                rest = words.pop() if is_cut else b""
                if len(rest) > _LAST_CHARACTERS:
                    raise MalformedFileError(f"{rest[:40]!r} is not a number")
                if len(words) >= left:
                    self.at = file.tell() - len(text) + _end_of_word(text, left)
                    words = words[:left]
                left -= len(words)
                if words:
                    yield words
                if not block:
                    break
        if left > 0:
            raise TruncatedFileError(f"the file ends after {count - left} of {count} numbers")


def _end_of_word(text: bytes, number: int) -> int:
    """Return the offset behind the word of this number, from 1."""
    for place, found in enumerate(_WORD.finditer(text), 1):
        if place == number:
            return found.end()
    return len(text)


def _to_numbers(words: list[bytes], kind: type[np.float64 | np.int64]) -> NDArray[np.generic]:
    for wanted in (kind, np.float64):  # integers may be written as 1.0
        try:
            numbers: NDArray[np.generic] = np.array(words, "S64").astype(wanted)
            return numbers
        except (ValueError, OverflowError):
            continue
    wrong = next((word for word in words if not _is_float(word)), b"")
    raise MalformedFileError(f"{wrong[:40].decode('latin1')!r} among numbers is not a number")


def _is_float(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
