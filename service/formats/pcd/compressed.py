"""The compressed encoding of PCD: one field after the other, all together packed by LZF."""

from __future__ import annotations

import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import PIECE_BYTES, ReadLimits, iter_ranges
from service.formats.disk import check_disk
from service.formats.errors import MalformedFileError, TruncatedFileError
from service.formats.pcd.header import PcdHeader

MAX_RATIO = 88
"""Ratio of expanded to compressed bytes: LZF expands 3 bytes to at most 264."""
_SIZES = struct.Struct("<II")
"""Compressed and expanded bytes, before the data."""
Fields = tuple[tuple[int, int], ...]
"""Index of a field, and which of its numbers."""


def read_compressed(
    path: Path, header: PcdHeader, fields: Fields
) -> tuple[list[NDArray[np.generic]], tuple[str, ...]]:
    """Return the columns of these fields, and warnings.

    Raises
    ------
    MalformedFileError
        The data is damaged; the message names the byte.
    """
    expanded = b"".join(_expand(path, header))
    starts = _column_starts(header, len(expanded))
    columns = [
        np.frombuffer(
            expanded, header.types[place], header.points * header.counts[place], starts[place]
        ).reshape(header.points, -1)[:, part]
        for place, part in fields
    ]
    packed, _ = _read_sizes(path, header)
    left = path.stat().st_size - header.size - _SIZES.size - packed
    return columns, (f"{left} bytes after the last point are ignored",) if left else ()


def iter_compressed(
    path: Path, header: PcdHeader, fields: Fields, limits: ReadLimits
) -> Iterator[list[NDArray[np.generic]]]:
    """Yield the columns in pieces; the fields are expanded into a temporary file.

    Raises
    ------
    MalformedFileError
        The data is damaged, or its context is an OSError with ENOSPC: too little of the disk
        would be left.
    """
    _, size = _read_sizes(path, header)
    starts = _column_starts(header, size)
    with tempfile.TemporaryFile(prefix="expanded-") as file:
        try:
            check_disk(Path(tempfile.gettempdir()), size, limits)
            file.writelines(_expand(path, header))
        except OSError as error:
            raise MalformedFileError(f"the points cannot be expanded: {error.strerror}") from None
        row_bytes = sum(int(header.types[place][2]) * header.counts[place] for place, _ in fields)
        for rows in iter_ranges(header.points, row_bytes):
            yield [_read_part(file, header, starts, field, rows) for field in fields]


def _read_part(
    file: IO[bytes], header: PcdHeader, starts: list[int], field: tuple[int, int], rows: range
) -> NDArray[np.generic]:
    place, part = field
    row_bytes = int(header.types[place][2]) * header.counts[place]
    file.seek(starts[place] + rows.start * row_bytes)
    content = file.read(len(rows) * row_bytes)
    return np.frombuffer(content, header.types[place]).reshape(len(rows), -1)[:, part]


def _read_sizes(path: Path, header: PcdHeader) -> tuple[int, int]:
    """Return the compressed and the expanded bytes, checked against the file and each other."""
    with path.open("rb") as file:
        file.seek(header.size)
        content = file.read(_SIZES.size)
    if len(content) < _SIZES.size:
        raise TruncatedFileError(f"byte {header.size}: the file ends before the compressed data")
    packed, size = _SIZES.unpack(content)
    start = header.size + _SIZES.size
    present = path.stat().st_size - start
    if packed > present:
        raise TruncatedFileError(
            f"byte {start}: {packed} compressed bytes are announced, {present} follow"
        )
    if size > packed * MAX_RATIO:
        raise MalformedFileError(f"byte {header.size}: {packed} bytes cannot expand to {size}")
    return packed, size


def _expand(path: Path, header: PcdHeader) -> Iterator[bytes]:
    """Yield consecutive parts of the expanded bytes, all of which are as many as announced."""
    from mpe_core.kernels.lzf import MAX_DISTANCE, expand_lzf  # loads the kernels

    left, size = _read_sizes(path, header)
    _column_starts(header, size)
    out = np.empty(MAX_DISTANCE + min(size, PIECE_BYTES) + 512, np.uint8)
    end, total, rest = 0, 0, b""
    with path.open("rb") as file:
        file.seek(header.size + _SIZES.size)
        while left:
            packed = np.frombuffer(rest + file.read(min(left, PIECE_BYTES)), np.uint8)
            left -= len(packed) - len(rest)
            place, before = 0, -1
            while place != before:
                before, begin = place, end
                place, end = expand_lzf(packed, place, out, begin)
                total += end - begin
                if end < 0 or total > size:
                    raise _damage(header, size)
                yield out[begin:end].tobytes()
                kept = min(end, MAX_DISTANCE)
                out[:kept] = out[end - kept : end].copy()
                end = kept
            rest = packed[place:].tobytes()
    if rest or total != size:
        raise _damage(header, size)


def _damage(header: PcdHeader, size: int) -> MalformedFileError:
    return MalformedFileError(
        f"byte {header.size + _SIZES.size}: the compressed data is damaged: it does not give "
        f"{size} bytes"
    )


def _column_starts(header: PcdHeader, size: int) -> list[int]:
    """Return the offset of each field's column.

    PCL leaves padding ("_") out of compressed data, other writers do not.
    """
    widths = [int(t[2]) * n for t, n in zip(header.types, header.counts, strict=True)]
    without = [0 if name == "_" else w for name, w in zip(header.fields, widths, strict=True)]
    for layout in (without, widths):
        if sum(layout) * header.points == size:
            return [header.points * sum(layout[:i]) for i in range(len(layout))]
    raise MalformedFileError(
        f"byte {header.size}: the data expands to {size} bytes; "
        f"{header.points} points need {sum(without) * header.points}"
    )
