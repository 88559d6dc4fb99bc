"""ASPRS LAS and LAZ files, read by laspy and lazrs; coordinates are scaled in float64.

The header is checked before laspy reads the file, because laspy trusts its counts.
"""

from __future__ import annotations

import logging
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import (
    FileLimitError,
    MalformedFileError,
    TruncatedFileError,
    UnsupportedFileError,
    short_reason,
)
from service.formats.libraries import import_library

MAGIC = b"LASF"
_MIN_HEADER_BYTES = 227
_VLR_BYTES, _EVLR_BYTES = 54, 60
_CHUNK_POINTS = 100_000
_MAX_CHUNK_POINTS = 16_000_000
_COMPRESSED_BIT = 0x80
"""Bit of the point format that marks LAZ."""
_ROW_BYTES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
"""Minimum bytes of a point in the point formats 0 to 10."""


@dataclass(frozen=True, slots=True)
class _PublicHeader:
    count: int
    offset: int  # byte of the first point
    row_bytes: int
    compressed: bool
    count_by_return: int  # sum over the returns; some writers leave it 0
    low: NDArray[np.float64]  # (3,) bounding box
    high: NDArray[np.float64]
    scale: float  # the coarsest of the three


def read(path: Path, limits: ReadLimits, *, attributes: bool = False) -> DecodedCloud:
    """Read the coordinates of all points, X * scale + offset in float64.

    `attributes` adds the other dimensions.

    Raises
    ------
    CloudFileError
        The file is damaged or of a kind that is not read; the message names the byte.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        header = _check_header(file.read(375), size, limits)
    if header.compressed:
        _check_chunk_table(path, header.offset, size)
    points, kept = _decode(path, header.count, attributes=attributes)
    if len(points) < header.count:
        raise TruncatedFileError(f"the file holds {len(points)} of {header.count} announced points")
    left = size - header.offset - header.count * header.row_bytes
    warnings = _check_bounds(header, points)
    if left > 0 and not header.compressed:
        warnings += (f"{left} bytes after the last point are ignored",)
    name = "laz" if header.compressed else "las"
    return DecodedCloud(points, name, warnings, attributes=kept)


def _check_bounds(header: _PublicHeader, points: NDArray[np.float64]) -> tuple[str, ...]:
    """Warn about points outside of the header's bounding box.

    Truncated LAZ data decodes to noise beyond its end: with an inconsistent count it is an error.
    """
    inside = (points >= header.low - header.scale) & (points <= header.high + header.scale)
    outside = len(points) - int(inside.all(axis=1).sum())
    if outside and header.compressed and header.count_by_return != header.count:
        raise MalformedFileError(
            f"byte 107: {header.count} points announced, but {header.count_by_return} by return, "
            f"and {outside} points lie outside of the header's bounds"
        )
    return (f"{outside} points lie outside of the header's bounds",) if outside else ()


def _check_header(head: bytes, size: int, limits: ReadLimits) -> _PublicHeader:
    if len(head) < _MIN_HEADER_BYTES:
        raise TruncatedFileError(f"byte {len(head)}: the file ends within the LAS header")
    major, minor = head[24], head[25]
    header_size, offset, records, kind, row, count = struct.unpack_from("<HIIBHI", head, 94)
    if major != 1 or minor > 4:
        raise UnsupportedFileError(f"byte 24: LAS version {major}.{minor}; 1.0 to 1.4 are read")
    if minor == 4:
        if len(head) < 375 or header_size < 375:
            raise TruncatedFileError(
                f"byte 94: the LAS 1.4 header has {min(len(head), header_size)} bytes, expected 375"
            )
        extended_at, extended, count = struct.unpack_from("<QIQ", head, 235)
        if extended and extended * _EVLR_BYTES > size - extended_at:
            raise TruncatedFileError(
                f"byte 243: {extended} extended records do not fit into the file"
            )
    if not _MIN_HEADER_BYTES <= header_size <= offset <= size:
        raise TruncatedFileError(
            f"byte 94: a header of {header_size} bytes and points from byte {offset}, "
            f"in a file of {size} bytes"
        )
    if records * _VLR_BYTES > offset - header_size:
        raise MalformedFileError(
            f"byte 100: {records} variable length records do not fit into "
            f"{offset - header_size} bytes"
        )
    compressed, kind = bool(kind & _COMPRESSED_BIT), kind & 0x3F
    if kind >= len(_ROW_BYTES) or row < _ROW_BYTES[kind]:
        raise MalformedFileError(
            f"byte 104: point format {kind} in rows of {row} bytes; expected a format of 0 to 10 "
            "and rows of its size"
        )
    if not np.isfinite(struct.unpack_from("<6d", head, 131)).all():
        raise MalformedFileError("byte 131: a scale or offset is not finite")
    check_count(count, 0 if compressed else row, size - offset, "byte 107", limits)
    by_return = struct.unpack_from("<15Q", head, 255) if minor == 4 else ()
    bounds = np.array(struct.unpack_from("<6d", head, 179)).reshape(3, 2)
    return _PublicHeader(
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
    """Check the announced number of LAZ chunks: lazrs aborts the process if it cannot allocate."""
    with path.open("rb") as file:
        file.seek(offset)
        (table,) = struct.unpack("<q", file.read(8).ljust(8, b"\0"))
        if table == -1:  # a writer that cannot seek back puts the offset at the end
            file.seek(size - 8)
            (table,) = struct.unpack("<q", file.read(8))
        if not offset <= table <= size - 8:
            raise TruncatedFileError(
                f"byte {offset}: the LAZ chunk table is announced at byte {table} of {size}"
            )
        file.seek(table + 4)
        (chunks,) = struct.unpack("<I", file.read(4))
    if chunks > size:
        raise TruncatedFileError(
            f"byte {table + 4}: {chunks} LAZ chunks do not fit into {size} bytes"
        )


def _decode(
    path: Path, count: int, *, attributes: bool
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.generic]]]:
    laspy = import_library("laspy")
    logging.getLogger("laspy").setLevel(logging.CRITICAL)  # it raises what it logs
    parts: list[NDArray[np.float64]] = [np.empty((0, 3))]
    kept: dict[str, list[NDArray[np.generic]]] = {}
    try:
        with laspy.open(path, laz_backend=laspy.LazBackend.Lazrs, read_evlrs=False) as file:
            _check_chunk_size(file.header)
            for chunk in file.chunk_iterator(_CHUNK_POINTS):
                parts.append(np.stack([chunk.x, chunk.y, chunk.z], axis=1))
                for name in _dimensions(chunk) if attributes else ():
                    kept.setdefault(name, []).append(np.array(chunk[name]))
                if sum(map(len, parts)) >= count:
                    break
    except BaseException as error:
        # lazrs also reports damage by a PanicException, which is a BaseException
        is_decoding_error = isinstance(error, Exception) or type(error).__name__ == "PanicException"
        if not is_decoding_error or isinstance(error, (MemoryError, FileLimitError)):
            raise
        raise MalformedFileError(f"the points cannot be decoded: {short_reason(error)}") from None
    columns = {name: np.concatenate(chunks) for name, chunks in kept.items()}
    return np.concatenate(parts), columns


def _dimensions(chunk: Any) -> list[str]:
    """List the dimensions beside the coordinates that hold one number for each point."""
    names = [name for name in chunk.point_format.dimension_names if name not in ("X", "Y", "Z")]
    return [name for name in names if np.ndim(chunk[name]) == 1]


def _check_chunk_size(header: object) -> None:
    """Check the size of LAZ chunks: each is decoded at once."""
    for record in getattr(header, "vlrs", ()):
        if type(record).__name__ == "LasZipVlr":
            (size,) = struct.unpack_from("<I", record.record_data, 12)
            if size not in (0, 0xFFFFFFFF) and size > _MAX_CHUNK_POINTS:
                raise FileLimitError(
                    f"LAZ chunks of {size} points; the limit is {_MAX_CHUNK_POINTS}"
                )
