"""PCD files of the Point Cloud Library: ASCII, binary and binary_compressed.

The compressed encoding stores the fields one after the other (all x, then all y, ...), packed by
LZF.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.column_names import find_normals, find_xyz
from service.formats.column_types import restore_type
from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import MalformedFileError, TruncatedFileError
from service.formats.libraries import import_library
from service.formats.memory_map import map_file
from service.formats.numerals import significant_line
from service.formats.pcd.header import PcdHeader, parse_header
from service.formats.text_table import ends_with_newline, read_columns

_FIRST_KEYS = (b"VERSION", b"FIELDS", b"COLUMNS")
_MAX_ATTRIBUTES = 400
"""Numbers beside the coordinates that are kept; descriptors (SHOT) have up to 352."""
_MAX_LZF_RATIO = 88
"""Ratio of expanded to compressed bytes: LZF expands 3 bytes to at most 264."""


def sniff(head: bytes) -> bool:
    """Whether the first line that is no comment belongs to a PCD header."""
    return significant_line(head).split(maxsplit=1)[:1] in ([key] for key in _FIRST_KEYS)


def read(path: Path, limits: ReadLimits, *, attributes: bool = False) -> DecodedCloud:
    """Read the points, normals and viewpoint of a PCD file.

    `attributes` adds the other fields of one number.

    Raises
    ------
    CloudFileError
        The file is malformed; the message names the line or byte.
    """
    with path.open("rb") as file:
        header = parse_header(file.read(limits.max_header_bytes), limits)
    xyz, normals = find_xyz(header.fields), find_normals(header.fields)
    if xyz is None:
        raise MalformedFileError(
            f"FIELDS {' '.join(header.fields)[:80]}: expected the fields x, y, z"
        )
    places = xyz + (normals or ())
    if any(header.counts[i] != 1 or header.types[i][1] not in "fiu" for i in places):
        raise MalformedFileError(
            "a coordinate or normal has a COUNT other than 1; expected one number"
        )
    fields = tuple((place, 0) for place in places)
    if attributes:
        fields += _other_fields(header, places)
    present = path.stat().st_size - header.size
    if header.data == "ascii":
        row_bytes = 2 * sum(header.counts)
        check_count(header.points, row_bytes, present + 1, "POINTS", limits)
        columns, warnings = _read_ascii(path, header, fields, limits)
    else:
        row_bytes = 1 if header.data == "binary_compressed" else header.row.itemsize
        check_count(header.points, row_bytes, present * _max_ratio(header), "POINTS", limits)
        decode = _read_compressed if header.data == "binary_compressed" else _read_binary
        columns, warnings = decode(map_file(path), header, fields)
    dtype = _precision(header, xyz)
    kept = {
        _field_name(header, place, part): restore_type(column, header.types[place][1:])
        for (place, part), column in zip(fields[3:], columns[3:], strict=True)
    }
    return DecodedCloud(
        np.stack(columns[:3], axis=1).astype(dtype, copy=False),
        "pcd",
        warnings,
        np.stack(columns[3:6], axis=1).astype(dtype, copy=False) if normals else None,
        header.viewpoint,
        kept if attributes else {},
    )


def _other_fields(header: PcdHeader, places: tuple[int, ...]) -> tuple[tuple[int, int], ...]:
    """Return the other fields whose name is unique: their index, and which of their numbers."""
    return tuple(
        (place, part)
        for place, name in enumerate(header.fields)
        if place not in places and name != "_" and header.fields.count(name) == 1
        for part in range(header.counts[place])
    )[:_MAX_ATTRIBUTES]


def _field_name(header: PcdHeader, place: int, part: int) -> str:
    name = header.fields[place]
    return name if header.counts[place] == 1 else f"{name}_{part}"


def _max_ratio(header: PcdHeader) -> int:
    return _MAX_LZF_RATIO if header.data == "binary_compressed" else 1


def _precision(header: PcdHeader, xyz: tuple[int, ...]) -> type[np.floating]:
    return np.float32 if all(header.types[i] == "<f4" for i in xyz) else np.float64


def _read_ascii(
    path: Path, header: PcdHeader, fields: tuple[tuple[int, int], ...], limits: ReadLimits
) -> tuple[list[NDArray[np.generic]], tuple[str, ...]]:
    starts = np.concatenate(([0], np.cumsum(header.counts)))
    columns = [int(starts[place]) + part for place, part in fields]
    table = read_columns(path, header.size, header.lines + 1, columns, limits, rows=header.points)
    ended = ends_with_newline(path)
    return list(table.T), () if ended else (
        "the last line has no line end: its last number may have been cut",
    )


def _read_binary(
    content: memoryview, header: PcdHeader, fields: tuple[tuple[int, int], ...]
) -> tuple[list[NDArray[np.generic]], tuple[str, ...]]:
    rows = np.frombuffer(content, header.row, header.points, header.size)
    left = len(content) - header.size - rows.nbytes
    warnings = (f"{left} bytes after the last point are ignored",) if left else ()
    return [rows[str(place)][:, part] for place, part in fields], warnings


def _read_compressed(
    content: memoryview, header: PcdHeader, fields: tuple[tuple[int, int], ...]
) -> tuple[list[NDArray[np.generic]], tuple[str, ...]]:
    lzf = import_library("lzf")
    start = header.size + 8
    if len(content) < start:
        raise TruncatedFileError(f"byte {header.size}: the file ends before the compressed data")
    packed, size = struct.unpack_from("<II", content, header.size)
    if packed > len(content) - start:
        raise TruncatedFileError(
            f"byte {start}: {packed} compressed bytes are announced, {len(content) - start} follow"
        )
    if size > packed * _MAX_LZF_RATIO:
        raise MalformedFileError(f"byte {header.size}: {packed} bytes cannot expand to {size}")
    starts = _column_starts(header, size)
    try:
        expanded = lzf.decompress(bytes(content[start : start + packed]), size) if size else b""
    except ValueError as error:
        raise MalformedFileError(f"byte {start}: the compressed data is damaged: {error}") from None
    if expanded is None or len(expanded) != size:
        raise MalformedFileError(f"byte {start}: the compressed data does not give {size} bytes")
    columns = [
        np.frombuffer(
            expanded, header.types[place], header.points * header.counts[place], starts[place]
        ).reshape(header.points, -1)[:, part]
        for place, part in fields
    ]
    left = len(content) - start - packed
    return columns, (f"{left} bytes after the last point are ignored",) if left else ()


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
