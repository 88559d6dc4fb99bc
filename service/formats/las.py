"""ASPRS LAS and LAZ, by laspy and lazrs; coordinates are scaled in float64.

The header is checked first: laspy trusts its counts.
"""

from __future__ import annotations

import logging
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, Limits, check_count
from service.formats.errors import (
    FileLimitError,
    MalformedFileError,
    TruncatedFileError,
    UnsupportedFileError,
)

MAGIC = b"LASF"
_SMALLEST_HEADER = 227
_VLR_BYTES, _EVLR_BYTES = 54, 60
_CHUNK = 100_000
_LARGEST_CHUNK = 16_000_000
_COMPRESSED = 0x80  # of the point format
_SIZES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)  # of the point formats 0 to 10


@dataclass(frozen=True, slots=True)
class _Header:
    count: int
    offset: int
    row: int
    compressed: bool
    by_return: int
    """Sum of the points by return; some writers leave it 0."""
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    scale: float


def read(path: Path, limits: Limits, *, attributes: bool = False) -> DecodedCloud:
    """Read the coordinates of all points, X * scale + offset in float64; the rest if asked for.

    Raises
    ------
    CloudFileError
        With the byte at fault where it is known.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        header = _check_header(file.read(375), size, limits)
    if header.compressed:
        _check_chunk_table(path, header.offset, size)
    points, kept = _decode(path, header.count, attributes=attributes)
    if len(points) < header.count:
        raise TruncatedFileError(f"{len(points)} points decoded, {header.count} are announced")
    left = size - header.offset - header.count * header.row
    warnings = _doubts(header, points)
    if left > 0 and not header.compressed:
        warnings += (f"{left} bytes after the last point are ignored",)
    name = "laz" if header.compressed else "las"
    return DecodedCloud(points, name, warnings, attributes=kept)


def _doubts(header: _Header, points: NDArray[np.float64]) -> tuple[str, ...]:
    """LAZ data that has ended goes on as noise: its points leave the box of the header."""
    inside = (points >= header.low - header.scale) & (points <= header.high + header.scale)
    outside = len(points) - int(inside.all(axis=1).sum())
    if outside and header.compressed and header.by_return != header.count:
        raise MalformedFileError(
            f"byte 107: {header.count} points announced, {header.by_return} by return, "
            f"and {outside} of them outside of the announced bounds"
        )
    return (f"{outside} points lie outside of the header's bounds",) if outside else ()


def _check_header(head: bytes, size: int, limits: Limits) -> _Header:
    if len(head) < _SMALLEST_HEADER:
        raise TruncatedFileError(f"byte {len(head)}: the file ends within the LAS header")
    major, minor = head[24], head[25]
    header_size, offset, records, kind, row, count = struct.unpack_from("<HIIBHI", head, 94)
    if major != 1 or minor > 4:
        raise UnsupportedFileError(f"byte 24: LAS version {major}.{minor}; 1.0 to 1.4 are read")
    if minor == 4:
        if len(head) < 375 or header_size < 375:
            raise TruncatedFileError(
                f"byte 94: a LAS 1.4 header of {min(len(head), header_size)} bytes"
            )
        extended_at, extended, count = struct.unpack_from("<QIQ", head, 235)
        if extended and extended * _EVLR_BYTES > size - extended_at:
            raise TruncatedFileError(f"byte 243: {extended} extended records do not fit")
    if not _SMALLEST_HEADER <= header_size <= offset <= size:
        raise TruncatedFileError(
            f"byte 94: a header of {header_size} bytes, points from byte {offset}, in {size} bytes"
        )
    if records * _VLR_BYTES > offset - header_size:
        raise MalformedFileError(f"byte 100: {records} records in {offset - header_size} bytes")
    compressed, kind = bool(kind & _COMPRESSED), kind & 0x3F
    if kind >= len(_SIZES) or row < _SIZES[kind]:
        raise MalformedFileError(f"byte 104: point format {kind} in rows of {row} bytes")
    if not np.isfinite(struct.unpack_from("<6d", head, 131)).all():
        raise MalformedFileError("byte 131: a scale or offset that is not finite")
    check_count(count, 0 if compressed else row, size - offset, "byte 107", limits)
    by_return = struct.unpack_from("<15Q", head, 255) if minor == 4 else ()
    bounds = np.array(struct.unpack_from("<6d", head, 179)).reshape(3, 2)
    return _Header(
        count,
        offset,
        row,
        compressed,
        sum(by_return or struct.unpack_from("<5I", head, 111)),
        bounds[:, 1],
        bounds[:, 0],
        max(map(abs, struct.unpack_from("<3d", head, 131))),
    )


def _check_chunk_table(path: Path, offset: int, size: int) -> None:
    """lazrs ends the process when memory for the announced number of chunks is not to be had."""
    with path.open("rb") as file:
        file.seek(offset)
        (table,) = struct.unpack("<q", file.read(8).ljust(8, b"\0"))
        if table == -1:  # a writer that could not seek back puts the place at the end
            file.seek(size - 8)
            (table,) = struct.unpack("<q", file.read(8))
        if not offset <= table <= size - 8:
            raise TruncatedFileError(f"byte {offset}: the LAZ chunk table is at byte {table}")
        file.seek(table + 4)
        (chunks,) = struct.unpack("<I", file.read(4))
    if chunks > size:
        raise TruncatedFileError(f"byte {table + 4}: {chunks} LAZ chunks in {size} bytes")


def _decode(
    path: Path, count: int, *, attributes: bool
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.generic]]]:
    import laspy

    logging.getLogger("laspy").setLevel(logging.CRITICAL)  # what it logs, it raises as well
    parts: list[NDArray[np.float64]] = [np.empty((0, 3))]
    kept: dict[str, list[NDArray[np.generic]]] = {}
    try:
        with laspy.open(path, laz_backend=laspy.LazBackend.Lazrs, read_evlrs=False) as file:
            _check_chunk_size(file.header)
            for chunk in file.chunk_iterator(_CHUNK):
                parts.append(np.stack([chunk.x, chunk.y, chunk.z], axis=1))
                for name in _dimensions(chunk) if attributes else ():
                    kept.setdefault(name, []).append(np.array(chunk[name]))
                if sum(map(len, parts)) >= count:
                    break
    except BaseException as error:
        # lazrs tells of a damaged file by a PanicException too, which is no Exception
        ours = isinstance(error, Exception) or type(error).__name__ == "PanicException"
        if not ours or isinstance(error, (MemoryError, FileLimitError)):
            raise
        raise MalformedFileError(f"the points cannot be decoded: {str(error)[:200]}") from None
    columns = {name: np.concatenate(chunks) for name, chunks in kept.items()}
    return np.concatenate(parts), columns


def _dimensions(chunk: Any) -> list[str]:
    """Names of the dimensions of one number beside the coordinates."""
    names = [name for name in chunk.point_format.dimension_names if name not in ("X", "Y", "Z")]
    return [name for name in names if np.ndim(chunk[name]) == 1]


def _check_chunk_size(header: object) -> None:
    """A LAZ file names the points of a chunk, which are decoded at once."""
    for record in getattr(header, "vlrs", ()):
        if type(record).__name__ == "LasZipVlr":
            (size,) = struct.unpack_from("<I", record.record_data, 12)
            if size not in (0, 0xFFFFFFFF) and size > _LARGEST_CHUNK:
                raise FileLimitError(f"LAZ chunks of {size} points; at most {_LARGEST_CHUNK}")
