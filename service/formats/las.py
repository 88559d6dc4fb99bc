"""ASPRS LAS and LAZ files, read by laspy and lazrs; coordinates are scaled in float64.

The header is checked before laspy reads the file, because laspy trusts its counts.
"""

from __future__ import annotations

import logging
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.crs import refuse_geographic
from service.formats.decoded_cloud import (
    DecodedCloud,
    ReadLimits,
    check_count,
    check_density,
    join_pieces,
)
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    TruncatedFileError,
    UnsupportedFileError,
    short_reason,
)
from service.formats.las_metadata import LasMetadata, LasRecord
from service.formats.libraries import import_library

MAGIC = b"LASF"
_MIN_HEADER_BYTES, _HEADER_BYTES_1_4, _HEADER_BYTES_1_5 = 227, 375, 393
_VLR_BYTES, _EVLR_BYTES = 54, 60
_CHUNK_POINTS = 100_000
_MAX_CHUNK_POINTS = 16_000_000
_ITEMS_AT = 34
"""Byte of the items in the record of LASzip: type, bytes and version of each."""
_ITEM_BYTES = {6: 20, 7: 8, 8: 6, 9: 29, 10: 30, 11: 6, 12: 8, 13: 29}
"""Bytes by the type of the item; those of extra bytes are free."""
_MAX_RECORD_BYTES = 1 << 20
"""Bytes of the records that are kept; real ones have some kilobytes."""
_MAX_EXTENDED = 1000
"""Records after the points that are looked at."""
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
    return join_pieces(read_pieces(path, limits, attributes=attributes))


def read_pieces(
    path: Path, limits: ReadLimits, *, attributes: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read` does, in consecutive pieces; the last has no points, but the warnings."""
    size = path.stat().st_size
    with path.open("rb") as file:
        header = _check_header(file.read(_HEADER_BYTES_1_4), size, limits)
    if header.compressed:
        _check_chunk_table(path, header.offset, size)
    name = "laz" if header.compressed else "las"
    count = outside = 0
    metadata: LasMetadata | None = None
    crs: tuple[LasRecord, ...] = ()
    for chunk, metadata, crs in _iter_chunks(path, header.count, attributes=attributes):
        points = np.stack([chunk.x, chunk.y, chunk.z], axis=1)
        kept = dict(_dimensions(chunk)) if attributes else {}
        count, outside = count + len(points), outside + _count_outside(header, points)
        yield DecodedCloud(points, name, attributes=kept, las=metadata, crs=crs)
    if count < header.count:
        raise TruncatedFileError(f"the file holds {count} of {header.count} announced points")
    left = size - header.offset - header.count * header.row_bytes
    warnings = _check_bounds(header, outside)
    if left > 0 and not header.compressed:
        warnings += (f"{left} bytes after the last point are ignored",)
    yield DecodedCloud(np.empty((0, 3)), name, warnings, las=metadata, crs=crs)


def read_crs(path: Path, limits: ReadLimits) -> tuple[LasRecord, ...]:
    """Read the records of the coordinate system; no point is decoded.

    Raises
    ------
    CloudFileError
        The file is damaged or of a kind that is not read; the message names the byte.
    """
    with path.open("rb") as file:
        _check_header(file.read(_HEADER_BYTES_1_4), path.stat().st_size, limits)
    laspy = import_library("laspy")
    with _translate_errors(), laspy.open(path, **_options(laspy)) as file:
        return _crs_records(path, file.header)


def _count_outside(header: _PublicHeader, points: NDArray[np.float64]) -> int:
    inside = (points >= header.low - header.scale) & (points <= header.high + header.scale)
    return len(points) - int(inside.all(axis=1).sum())


def _check_bounds(header: _PublicHeader, outside: int) -> tuple[str, ...]:
    """Warn about points outside of the header's bounding box.

    Truncated LAZ data decodes to noise beyond its end: with an inconsistent count it is an error.
    """
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
    if major != 1 or minor > 5:
        raise UnsupportedFileError(f"byte 24: LAS version {major}.{minor}; 1.0 to 1.5 are read")
    if minor >= 4:
        expected = _HEADER_BYTES_1_4 if minor == 4 else _HEADER_BYTES_1_5
        if len(head) < _HEADER_BYTES_1_4 or header_size < expected:
            raise TruncatedFileError(
                f"byte 94: the LAS 1.{minor} header has {min(len(head), header_size)} bytes, "
                f"expected {expected}"
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
    if 0.0 in struct.unpack_from("<3d", head, 131):
        raise MalformedFileError("byte 131: a scale is 0, so that all points lie in a plane")
    check_count(count, 0 if compressed else row, size - offset, "byte 107", limits)
    check_density(count, size, "byte 107")
    by_return = struct.unpack_from("<15Q", head, 255) if minor >= 4 else ()
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


def _iter_chunks(
    path: Path, count: int, *, attributes: bool
) -> Iterator[tuple[Any, LasMetadata | None, tuple[LasRecord, ...]]]:
    """Yield the points as laspy decodes them, with what the file says beside them if wanted."""
    laspy = import_library("laspy")
    with _translate_errors(), laspy.open(path, **_options(laspy)) as file:
        _check_laszip(file.header)
        metadata = _read_metadata(file.header) if attributes else None
        crs = _crs_records(path, file.header)
        refuse_geographic(crs)
        found = 0
        for chunk in file.chunk_iterator(_CHUNK_POINTS):
            found += len(chunk)
            yield chunk, metadata, crs
            if found >= count:
                break


@contextmanager
def _translate_errors() -> Iterator[None]:
    """Turn the errors of laspy and lazrs on damaged files into MalformedFileError."""
    logging.getLogger("laspy").setLevel(logging.CRITICAL)  # it raises what it logs
    try:
        yield
    except BaseException as error:
        # lazrs also reports damage by a PanicException, which is a BaseException
        is_decoding_error = isinstance(error, Exception) or type(error).__name__ == "PanicException"
        if not is_decoding_error or isinstance(error, (MemoryError, CloudFileError)):
            raise
        raise MalformedFileError(f"the points cannot be decoded: {short_reason(error)}") from None


def _options(laspy: Any) -> dict[str, Any]:
    return {"laz_backend": laspy.LazBackend.Lazrs, "read_evlrs": False}


def _dimensions(chunk: Any) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Yield the dimensions beside the coordinates; of those with several numbers each of them."""
    for name in chunk.point_format.dimension_names:
        if name in ("X", "Y", "Z"):
            continue
        column = np.array(chunk[name])
        if column.ndim == 1:
            yield name, column
        else:
            yield from ((f"{name}_{i}", column[:, i]) for i in range(column.shape[1]))


def _read_metadata(header: Any) -> LasMetadata:
    time_type = header.global_encoding.gps_time_type
    records = tuple(filter(lambda record: record.is_kept, _records(header)))
    scale = float(np.abs(header.scales).min())
    return LasMetadata(
        min(str(header.version), "1.4"),  # LAS 1.5 is written as LAS 1.4
        int(header.point_format.id),
        scale if np.isfinite(scale) and scale > 0 else None,
        time_type.name == "STANDARD",
        records if sum(len(record.data) for record in records) <= _MAX_RECORD_BYTES else (),
        {item.name: str(item.description) for item in header.point_format.extra_dimensions},
    )


def _records(header: Any) -> Iterator[LasRecord]:
    for item in header.vlrs:
        data = bytes(item.record_data_bytes())
        yield LasRecord(str(item.user_id), int(item.record_id), str(item.description), data)


def _crs_records(path: Path, header: Any) -> tuple[LasRecord, ...]:
    """Return the records of the coordinate system, also those after the points."""
    extended = _extended_records(path) if header.version.minor >= 4 else ()
    return tuple(item for item in (*_records(header), *extended) if item.is_crs)


def _extended_records(path: Path) -> Iterator[LasRecord]:
    """Read the records after the points of LAS 1.4 that describe the coordinate system."""
    with path.open("rb") as file:
        head = file.read(247)
        offset, count = struct.unpack_from("<QI", head, 235)
        for _ in range(min(count, _MAX_EXTENDED)):
            file.seek(offset)
            entry = file.read(_EVLR_BYTES)
            if len(entry) < _EVLR_BYTES:
                return
            user, kind, length, text = struct.unpack("<2x16sHQ32s", entry)
            names = [name.split(b"\0")[0].decode("latin1") for name in (user, text)]
            record = LasRecord(names[0], kind, names[1], b"")
            if record.is_crs and length <= _MAX_RECORD_BYTES:
                yield replace(record, data=file.read(length))
            offset += _EVLR_BYTES + length


def _check_laszip(header: Any) -> None:
    """Check how LAZ is compressed, which lazrs trusts.

    Each chunk is decoded at once, and points of another size are written past the end of memory.
    """
    for record in header.vlrs:
        if type(record).__name__ == "LasZipVlr":
            data = record.record_data
            (size,) = struct.unpack_from("<I", data, 12)
            if size not in (0, 0xFFFFFFFF) and size > _MAX_CHUNK_POINTS:
                raise FileLimitError(
                    f"LAZ chunks of {size} points; the limit is {_MAX_CHUNK_POINTS}"
                )
            (count,) = struct.unpack_from("<H", data, _ITEMS_AT - 2)
            items = [struct.unpack_from("<HH", data, _ITEMS_AT + 6 * i) for i in range(count)]
            if any(_ITEM_BYTES.get(kind, bytes_) != bytes_ for kind, bytes_ in items) or (
                sum(bytes_ for _, bytes_ in items) != header.point_format.size
            ):
                raise MalformedFileError(
                    f"the LAZ record compresses items of {[bytes_ for _, bytes_ in items][:20]} "
                    f"bytes; expected those of a point of {header.point_format.size} bytes"
                )
