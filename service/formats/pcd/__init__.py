"""The Point Cloud Library's PCD: ASCII, binary and binary_compressed.

The compressed kind stores one field after the other (all x, then all y, ...), packed by LZF.
"""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.column_names import find_normals, find_xyz
from service.formats.decoded_cloud import DecodedCloud, Limits, check_count
from service.formats.errors import MalformedFileError, TruncatedFileError
from service.formats.memory_map import mapped
from service.formats.pcd.header import Header, parse_header
from service.formats.text_table import ends_with_newline, read_columns

_START = re.compile(rb"(\s*#[^\n]*\n)*\s*(VERSION|FIELDS|COLUMNS)\s")
_MOST_PER_BYTE = 88
"""LZF expands at most 264 bytes from 3."""


def sniff(head: bytes) -> bool:
    """Whether the first line that is no comment is one of a PCD header."""
    return _START.match(head) is not None


def read(path: Path, limits: Limits, *, attributes: bool = False) -> DecodedCloud:
    """Read the points, normals and viewpoint of a PCD file, and all single fields if asked for.

    Raises
    ------
    CloudFileError
        With the line or byte at fault.
    """
    with path.open("rb") as file:
        header = parse_header(file.read(limits.max_header_bytes), limits)
    xyz, normals = find_xyz(header.fields), find_normals(header.fields)
    if xyz is None:
        raise MalformedFileError(f"FIELDS {' '.join(header.fields)[:80]}: no x, y, z")
    places = xyz + (normals or ())
    if attributes:
        places += _others(header, places)
    if any(header.counts[i] != 1 or header.types[i][1] not in "fiu" for i in places):
        raise MalformedFileError("a coordinate with a COUNT other than 1")
    present = path.stat().st_size - header.size
    if header.data == "ascii":
        row_bytes = 2 * sum(header.counts)
        check_count(header.points, row_bytes, present + 1, "POINTS", limits)
        columns, warnings = _ascii(path, header, places, limits)
    else:
        row_bytes = 1 if header.data == "binary_compressed" else header.row.itemsize
        check_count(header.points, row_bytes, present * _ratio(header), "POINTS", limits)
        decode = _compressed if header.data == "binary_compressed" else _binary
        columns, warnings = decode(mapped(path), header, places)
    dtype = _precision(header, xyz)
    kept = {
        header.fields[place]: column.astype(header.types[place][1:])
        for place, column in zip(places[3:], columns[3:], strict=True)
    }
    return DecodedCloud(
        np.stack(columns[:3], axis=1).astype(dtype, copy=False),
        "pcd",
        warnings,
        np.stack(columns[3:6], axis=1).astype(dtype, copy=False) if normals else None,
        header.viewpoint,
        kept if attributes else {},
    )


def _others(header: Header, places: tuple[int, ...]) -> tuple[int, ...]:
    """Places of the other fields of one number; those that share a name are left out."""
    return tuple(
        place
        for place, name in enumerate(header.fields)
        if place not in places and header.counts[place] == 1 and header.fields.count(name) == 1
    )


def _ratio(header: Header) -> int:
    return _MOST_PER_BYTE if header.data == "binary_compressed" else 1


def _precision(header: Header, xyz: tuple[int, ...]) -> type[np.floating]:
    return np.float32 if all(header.types[i] == "<f4" for i in xyz) else np.float64


def _ascii(
    path: Path, header: Header, places: tuple[int, ...], limits: Limits
) -> tuple[list[NDArray[np.generic]], tuple[str, ...]]:
    starts = np.concatenate(([0], np.cumsum(header.counts)))
    columns = [int(starts[place]) for place in places]
    table = read_columns(path, header.size, header.lines + 1, columns, limits, rows=header.points)
    ended = ends_with_newline(path)
    return list(table.T), () if ended else ("the last line is not ended: it may have been cut",)


def _binary(
    content: memoryview, header: Header, places: tuple[int, ...]
) -> tuple[list[NDArray[np.generic]], tuple[str, ...]]:
    rows = np.frombuffer(content, header.row, header.points, header.size)
    left = len(content) - header.size - rows.nbytes
    warnings = (f"{left} bytes after the last point are ignored",) if left else ()
    return [rows[str(place)][:, 0] for place in places], warnings


def _compressed(
    content: memoryview, header: Header, places: tuple[int, ...]
) -> tuple[list[NDArray[np.generic]], tuple[str, ...]]:
    import lzf

    start = header.size + 8
    if len(content) < start:
        raise TruncatedFileError(f"byte {header.size}: the file ends before the compressed sizes")
    packed, size = struct.unpack_from("<II", content, header.size)
    if packed > len(content) - start:
        raise TruncatedFileError(
            f"byte {start}: {packed} compressed bytes announced, {len(content) - start} are there"
        )
    if size > packed * _MOST_PER_BYTE:
        raise MalformedFileError(f"byte {header.size}: {packed} bytes cannot expand to {size}")
    starts = _column_starts(header, size)
    try:
        expanded = lzf.decompress(bytes(content[start : start + packed]), size) if size else b""
    except ValueError as error:
        raise MalformedFileError(f"byte {start}: the compressed data is damaged: {error}") from None
    if expanded is None or len(expanded) != size:
        raise MalformedFileError(f"byte {start}: the compressed data does not give {size} bytes")
    columns = [
        np.frombuffer(expanded, header.types[place], header.points, starts[place])
        for place in places
    ]
    left = len(content) - start - packed
    return columns, (f"{left} bytes after the last point are ignored",) if left else ()


def _column_starts(header: Header, size: int) -> list[int]:
    """Where each field's column begins; PCL leaves padding ("_") out, other writers do not."""
    widths = [int(t[2]) * n for t, n in zip(header.types, header.counts, strict=True)]
    without = [0 if name == "_" else w for name, w in zip(header.fields, widths, strict=True)]
    for layout in (without, widths):
        if sum(layout) * header.points == size:
            return [header.points * sum(layout[:i]) for i in range(len(layout))]
    raise MalformedFileError(
        f"byte {header.size}: {size} bytes for {header.points} points, "
        f"expected {sum(without) * header.points}"
    )
