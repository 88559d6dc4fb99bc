"""Legacy VTK files: the points of poly data and of unstructured or structured grids."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import (
    DecodedCloud,
    ReadLimits,
    check_count,
    iter_ranges,
    join_pieces,
)
from service.formats.errors import MalformedFileError, TruncatedFileError, UnsupportedFileError
from service.formats.memory_map import map_file

MAGIC = b"# vtk DataFile"
_MAX_HEADER_BYTES = 1 << 20
_DATASETS = (b"POLYDATA", b"UNSTRUCTURED_GRID", b"STRUCTURED_GRID")
_POINTS = re.compile(rb"^POINTS[ \t]+(\d{1,18})[ \t]+(\w{1,20})[ \t]*\r?\n", re.MULTILINE)
_TYPES = {
    b"float": ">f4", b"double": ">f8", b"int": ">i4", b"short": ">i2", b"char": "i1",
    b"unsigned_char": "u1", b"unsigned_short": ">u2", b"unsigned_int": ">u4", b"long": ">i8",
}  # fmt: skip
_BLOCK_BYTES = 1 << 22
_LAST_CHARACTERS = 64
"""Characters kept between blocks of text, in which the last number may be cut."""


def read(path: Path, limits: ReadLimits, *, attributes: bool = False) -> DecodedCloud:
    """Read the points in ASCII or binary; `attributes` are not read, which a warning says.

    Raises
    ------
    CloudFileError
        The file is damaged, or its data set has no points of its own.
    """
    return join_pieces(read_pieces(path, limits, attributes=attributes))


def read_pieces(
    path: Path, limits: ReadLimits, *, attributes: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read` does, in consecutive pieces; the last has no points, but the warnings."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_MAX_HEADER_BYTES)
    encoding = _check_header(head)
    found = _POINTS.search(head)
    if found is None or found[2].lower() not in _TYPES:
        raise MalformedFileError("no line 'POINTS n type'; expected one with a type of numbers")
    count, kind = int(found[1]), np.dtype(_TYPES[found[2].lower()])
    row_bytes = 6 if encoding == b"ASCII" else 3 * kind.itemsize
    check_count(count, row_bytes, size - found.end() + 1, "POINTS", limits)
    is_text = encoding == b"ASCII"
    read = _iter_ascii(path, found.end(), count) if is_text else _iter_binary(path, found, kind)
    target = np.float32 if kind == np.dtype(">f4") else np.float64
    got = 0
    for numbers in read:
        got += len(numbers) // 3
        points: NDArray[np.floating] = numbers.astype(target)
        yield DecodedCloud(points.reshape(-1, 3), "vtk")
    if got < count:
        raise TruncatedFileError(f"the file ends after {got} of {count} points")
    warnings = ("cells and attributes of VTK are not kept",) if attributes else ()
    yield DecodedCloud(np.empty((0, 3), target), "vtk", warnings)


def _iter_binary(
    path: Path, points: re.Match[bytes], kind: np.dtype[np.generic]
) -> Iterator[NDArray[np.generic]]:
    """Yield the numbers of consecutive points."""
    row_bytes = 3 * kind.itemsize
    for rows in iter_ranges(int(points[1]), row_bytes):
        start = points.end() + rows.start * row_bytes
        size = min(len(rows) * row_bytes, path.stat().st_size - start) // row_bytes * row_bytes
        if size > 0:
            yield np.frombuffer(map_file(path, start, size), kind)


def _check_header(head: bytes) -> bytes:
    """Return the encoding, ASCII or BINARY."""
    lines = head.split(b"\n", 12)
    encoding = lines[2].strip().upper() if len(lines) > 2 else b""
    if encoding not in (b"ASCII", b"BINARY"):
        raise MalformedFileError(f"line 3: {encoding[:40]!r}; expected ASCII or BINARY")
    words = next((line.split() for line in lines[3:] if line.startswith(b"DATASET")), [])
    dataset = words[1].upper() if len(words) > 1 else b""
    if dataset not in _DATASETS:
        known = ", ".join(name.decode() for name in _DATASETS)
        raise UnsupportedFileError(
            f"DATASET {dataset[:40].decode('latin1')!r} has no list of points; expected one of "
            f"{known}: save it as poly data"
        )
    return encoding


def _iter_ascii(path: Path, offset: int, count: int) -> Iterator[NDArray[np.float64]]:
    """Yield the numbers of consecutive points, between blanks, whatever their number in a line."""
    left = 3 * count
    with path.open("rb") as file:
        file.seek(offset)
        rest, over = b"", np.empty(0)
        while left > 0:
            block = file.read(_BLOCK_BYTES)
            words = (rest + block).split()
            is_cut = bool(block and words) and not block[-1:].isspace()
            rest = words.pop() if is_cut else b""
            if len(rest) > _LAST_CHARACTERS:
                raise MalformedFileError(f"{rest[:40]!r} is not a number")
            numbers = np.concatenate([over, _to_numbers(words[:left])])
            left -= len(numbers) - len(over)
            whole = len(numbers) // 3 * 3
            yield numbers[:whole]
            over = numbers[whole:]
            if not block:
                break


def _to_numbers(words: list[bytes]) -> NDArray[np.float64]:
    try:
        return np.array(words, "S64").astype(np.float64) if words else np.empty(0)
    except ValueError:
        wrong = next((word for word in words if not _is_float(word)), b"")
        raise MalformedFileError(
            f"{wrong[:40].decode('latin1')!r} among the points is not a number"
        ) from None


def _is_float(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
