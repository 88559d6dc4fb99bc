"""The Point Cloud Library's PCD: ASCII, binary and binary_compressed.

The compressed kind stores one field after the other (all x, then all y, ...), packed by LZF.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.cloud import DecodedCloud, Limits, check_count
from service.formats.errors import FileLimitError, MalformedFileError, TruncatedFileError
from service.formats.mapped import mapped
from service.formats.names import find_normals, find_xyz
from service.formats.table import ends_with_newline, read_columns

_START = re.compile(rb"(\s*#[^\n]*\n)*\s*(VERSION|FIELDS|COLUMNS)\s")
_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS")
_TYPES = {"F4", "F8", "I1", "I2", "I4", "I8", "U1", "U2", "U4", "U8"}
_MOST_PER_BYTE = 88
"""LZF expands at most 264 bytes from 3."""


@dataclass(frozen=True, slots=True)
class _Header:
    fields: tuple[str, ...]
    types: tuple[str, ...]  # NumPy's codes: "<f4"
    counts: tuple[int, ...]
    points: int
    data: str
    viewpoint: tuple[float, ...] | None
    size: int  # bytes
    lines: int

    @property
    def row(self) -> np.dtype[np.void]:
        """Layout of a point; fields are named by their place, for names may repeat ("_")."""
        return np.dtype(
            [
                (str(i), t, (n,))
                for i, (t, n) in enumerate(zip(self.types, self.counts, strict=True))
            ]
        )


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
        header = _parse(file.read(limits.max_header_bytes), limits)
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


def _others(header: _Header, places: tuple[int, ...]) -> tuple[int, ...]:
    """Places of the other fields of one number; those that share a name are left out."""
    return tuple(
        place
        for place, name in enumerate(header.fields)
        if place not in places and header.counts[place] == 1 and header.fields.count(name) == 1
    )


def _ratio(header: _Header) -> int:
    return _MOST_PER_BYTE if header.data == "binary_compressed" else 1


def _precision(header: _Header, xyz: tuple[int, ...]) -> type[np.floating]:
    return np.float32 if all(header.types[i] == "<f4" for i in xyz) else np.float64


def _ascii(
    path: Path, header: _Header, places: tuple[int, ...], limits: Limits
) -> tuple[list[NDArray[np.generic]], tuple[str, ...]]:
    starts = np.concatenate(([0], np.cumsum(header.counts)))
    columns = [int(starts[place]) for place in places]
    table = read_columns(path, header.size, header.lines + 1, columns, limits, rows=header.points)
    ended = ends_with_newline(path)
    return list(table.T), () if ended else ("the last line is not ended: it may have been cut",)


def _binary(
    content: memoryview, header: _Header, places: tuple[int, ...]
) -> tuple[list[NDArray[np.generic]], tuple[str, ...]]:
    rows = np.frombuffer(content, header.row, header.points, header.size)
    left = len(content) - header.size - rows.nbytes
    warnings = (f"{left} bytes after the last point are ignored",) if left else ()
    return [rows[str(place)][:, 0] for place in places], warnings


def _compressed(
    content: memoryview, header: _Header, places: tuple[int, ...]
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


def _column_starts(header: _Header, size: int) -> list[int]:
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


def _parse(head: bytes, limits: Limits) -> _Header:
    values: dict[str, list[str]] = {}
    offset = 0
    for number in range(1, limits.max_header_lines + 1):
        end = head.find(b"\n", offset)
        if end < 0:
            break
        key, *rest = head[offset:end].decode("latin1").split() or ["#"]
        offset = end + 1
        if key.startswith("#"):
            continue
        key = "FIELDS" if key == "COLUMNS" else key
        if key == "DATA":
            return _header(values, " ".join(rest), offset, number, limits)
        if key not in _KEYS or key in values:
            raise MalformedFileError(f"line {number}: {key[:40]!r} in a PCD header")
        values[key] = rest
    if len(head) < limits.max_header_bytes and end < 0:
        raise TruncatedFileError("the file ends before the DATA line of the PCD header")
    raise FileLimitError(
        f"no DATA line in the first {limits.max_header_lines} lines "
        f"or {limits.max_header_bytes} bytes"
    )


def _header(
    values: dict[str, list[str]], data: str, size: int, lines: int, limits: Limits
) -> _Header:
    if data not in ("ascii", "binary", "binary_compressed"):
        raise MalformedFileError(f"line {lines}: DATA {data[:40]!r}")
    fields = tuple(values.get("FIELDS", ()))
    if len(fields) > limits.max_properties:
        raise FileLimitError(f"{len(fields)} FIELDS; at most {limits.max_properties} are read")
    counts = tuple(_integers(values, "COUNT", [1] * len(fields)))
    types = [
        f"{kind}{width}"
        for kind, width in zip(values.get("TYPE", ()), values.get("SIZE", ()), strict=False)
    ]
    if not len(fields) == len(types) == len(counts):
        raise MalformedFileError(
            f"FIELDS, SIZE, TYPE and COUNT differ: {len(fields)}, {len(values.get('SIZE', ()))}, "
            f"{len(values.get('TYPE', ()))}, {len(counts)} entries"
        )
    if not _TYPES.issuperset(types) or not all(0 < n <= 1 << 16 for n in counts):
        raise MalformedFileError(f"TYPE, SIZE or COUNT out of range: {types[:9]}, {counts[:9]}")
    return _Header(
        fields,
        tuple(f"<{item.lower()}" for item in types),
        counts,
        _point_count(values),
        data,
        _viewpoint(values),
        size,
        lines,
    )


def _point_count(values: dict[str, list[str]]) -> int:
    (width,) = _integers(values, "WIDTH", [0])
    (height,) = _integers(values, "HEIGHT", [1])
    (points,) = _integers(values, "POINTS", [width * height])
    if "WIDTH" in values and points != width * height:
        raise MalformedFileError(f"POINTS {points}, but WIDTH x HEIGHT is {width * height}")
    return points


def _integers(values: dict[str, list[str]], key: str, default: list[int]) -> list[int]:
    if key not in values:
        return default
    words = values[key]
    if len(words) != max(1, len(default)) or not all(w.isdecimal() and len(w) < 19 for w in words):
        raise MalformedFileError(f"{key} {' '.join(words)[:60]}: expected {len(default)} counts")
    return [int(word) for word in words]


def _viewpoint(values: dict[str, list[str]]) -> tuple[float, ...] | None:
    if "VIEWPOINT" not in values:
        return None
    try:
        numbers = tuple(float(word) for word in values["VIEWPOINT"])
    except ValueError:
        numbers = ()
    if len(numbers) != 7:
        raise MalformedFileError(f"VIEWPOINT {' '.join(values['VIEWPOINT'])[:60]}: not 7 numbers")
    return numbers
