"""PCD files of the Point Cloud Library: ASCII, binary and binary_compressed."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.announced_rows import AnnouncedRows
from service.formats.column_names import find_normals, find_xyz
from service.formats.column_types import restore_type
from service.formats.column_words import NORMAL_NAMES, POINT_NAMES
from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count, iter_ranges
from service.formats.errors import MalformedFileError
from service.formats.memory_map import map_file
from service.formats.numerals import significant_line
from service.formats.pcd.compressed import MAX_RATIO, Fields, iter_compressed, read_compressed
from service.formats.pcd.header import PcdHeader, parse_header

_FIRST_KEYS = (b"VERSION", b"FIELDS", b"COLUMNS")
_FURTHER_KEYS = (b"SIZE", b"TYPE", b"COUNT", b"WIDTH", b"HEIGHT", b"POINTS", b"DATA")
_MAX_ATTRIBUTES = 400
"""Numbers beside the coordinates that are kept; descriptors (SHOT) have up to 352."""


def sniff(head: bytes) -> bool:
    """Whether the first line that is no comment belongs to a PCD header."""
    text = head.replace(b"\r", b"\n").upper()
    words = {line.split(maxsplit=1)[0] for line in text.split(b"\n") if line.strip()}
    is_header = not words.isdisjoint(_FURTHER_KEYS)
    return is_header and significant_line(text).split(maxsplit=1)[:1] in (
        [key] for key in _FIRST_KEYS
    )


def read(path: Path, limits: ReadLimits, *, attributes: bool = False) -> DecodedCloud:
    """Read the points, normals and viewpoint of a PCD file.

    `attributes` adds the other fields of one number.

    Raises
    ------
    CloudFileError
        The file is malformed; the message names the line or byte.
    """
    layout = _read_layout(path, limits, attributes=attributes)
    header, fields = layout.header, layout.fields
    if header.data == "ascii":
        rows = layout.rows(path)
        columns, warnings = list(rows.read(limits).T), rows.warnings(limits)
    elif header.data == "binary_compressed":
        columns, warnings = read_compressed(path, header, fields)
    else:
        columns, warnings = _read_binary(map_file(path), header, fields)
    return replace(layout.to_cloud(columns), warnings=warnings)


def read_pieces(
    path: Path, limits: ReadLimits, *, attributes: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read` does, in consecutive pieces."""
    layout = _read_layout(path, limits, attributes=attributes)
    header, fields = layout.header, layout.fields
    if header.data == "binary_compressed":
        yield from map(layout.to_cloud, iter_compressed(path, header, fields, limits))
        return
    if header.data == "ascii":
        text = layout.rows(path)
        for table in text.read_pieces(limits):
            yield layout.to_cloud(list(table.T))
        yield DecodedCloud(np.empty((0, 3)), "pcd", text.warnings(limits))
        return
    row_bytes = header.row.itemsize
    for rows in iter_ranges(header.points, row_bytes):
        content = map_file(path, header.size + rows.start * row_bytes, len(rows) * row_bytes)
        piece = replace(header, size=0, points=len(rows))
        yield layout.to_cloud(_read_binary(content, piece, fields)[0])


@dataclass(frozen=True, slots=True)
class _Layout:
    """Which numbers of the file are read."""

    header: PcdHeader
    fields: Fields
    """Index of the field, and which of its numbers: coordinates, normals, attributes."""
    has_normals: bool
    keeps_attributes: bool

    def rows(self, path: Path) -> AnnouncedRows:
        """Find the points of an ASCII file."""
        header = self.header
        starts = np.concatenate(([0], np.cumsum(header.counts)))
        columns = [int(starts[place]) + part for place, part in self.fields]
        return AnnouncedRows.at(path, header.size, header.lines + 1, columns, header.points)

    def to_cloud(self, columns: list[NDArray[np.generic]]) -> DecodedCloud:
        """Make a cloud of the numbers."""
        header = self.header
        places = tuple(place for place, _ in self.fields[:3])
        dtype = _precision(header, places)
        kept: dict[str, NDArray[np.generic]] = {}
        if self.keeps_attributes:
            kept = {
                _field_name(header, place, part): restore_type(column, header.types[place][1:])
                for (place, part), column in zip(self.fields[3:], columns[3:], strict=True)
            }
        normals = np.stack(columns[3:6], axis=1) if self.has_normals else None
        return DecodedCloud(
            np.stack(columns[:3], axis=1).astype(dtype, copy=False),
            "pcd",
            (),
            None if normals is None else normals.astype(dtype, copy=False),
            () if header.viewpoint is None else (header.viewpoint,),
            kept,
        )


def _read_layout(path: Path, limits: ReadLimits, *, attributes: bool) -> _Layout:
    """Read the header, and check its counts."""
    with path.open("rb") as file:
        header = parse_header(file.read(limits.max_header_bytes), limits)
    xyz = _find_numbers(header, find_xyz(header.fields), POINT_NAMES)
    if xyz is None:
        raise MalformedFileError(
            f"FIELDS {' '.join(header.fields)[:80]}: expected the fields x, y, z, or one of three "
            "numbers called xyz"
        )
    normals = _find_numbers(header, find_normals(header.fields), NORMAL_NAMES)
    fields = xyz + (normals or ())
    places = tuple(place for place, _ in fields)
    if attributes:
        fields += _other_fields(header, places)
    present = path.stat().st_size - header.size
    if header.data == "ascii":
        check_count(header.points, 2 * sum(header.counts), present + 1, "POINTS", limits)
    else:
        row_bytes = 1 if header.data == "binary_compressed" else header.row.itemsize
        check_count(header.points, row_bytes, present * _max_ratio(header), "POINTS", limits)
    return _Layout(header, fields, normals is not None, attributes)


def _find_numbers(
    header: PcdHeader, places: tuple[int, ...] | None, names: Collection[str]
) -> Fields | None:
    """Return the numbers of these fields, or the three of one field of one of these names.

    Raises
    ------
    MalformedFileError
        The fields do not hold one number each.
    """
    if places is None:
        vectors = [
            place
            for place, name in enumerate(header.fields)
            if name.lower() in names and header.counts[place] == 3
        ]
        return tuple((vectors[0], part) for part in range(3)) if len(vectors) == 1 else None
    if any(header.counts[place] != 1 for place in places):
        raise MalformedFileError(
            "a coordinate or normal has a COUNT other than 1; expected one number"
        )
    return tuple((place, 0) for place in places)


def _other_fields(header: PcdHeader, places: tuple[int, ...]) -> Fields:
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
    return MAX_RATIO if header.data == "binary_compressed" else 1


def _precision(header: PcdHeader, xyz: tuple[int, ...]) -> type[np.floating]:
    return np.float32 if all(header.types[i] == "<f4" for i in xyz) else np.float64


def _read_binary(
    content: memoryview, header: PcdHeader, fields: Fields
) -> tuple[list[NDArray[np.generic]], tuple[str, ...]]:
    rows = np.frombuffer(content, header.row, header.points, header.size)
    left = len(content) - header.size - rows.nbytes
    warnings = (f"{left} bytes after the last point are ignored",) if left else ()
    return [rows[str(place)][:, part] for place, part in fields], warnings
