"""Stanford's PLY: ASCII and binary of both byte orders, any elements and properties.

Only the vertices are read; elements before them are stepped over.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, Limits, check_count
from service.formats.errors import MalformedFileError, TruncatedFileError
from service.formats.memory_map import mapped
from service.formats.ply.header import Element, Header, parse_header
from service.formats.ply.rows import read_rows
from service.formats.text_table import ends_with_newline, read_columns

MAGIC = b"ply"
_XYZ = ("x", "y", "z")
_NORMALS = ("nx", "ny", "nz")


def read(path: Path, limits: Limits, *, attributes: bool = False) -> DecodedCloud:
    """Read the vertices of a PLY file, with all their scalar properties if asked for.

    Raises
    ------
    CloudFileError
        With the line or byte at fault.
    """
    with path.open("rb") as file:
        head = file.read(limits.max_header_bytes)
    header = parse_header(head, limits)
    before, vertex, after = _around_vertex(header)
    _check_sizes(header, path.stat().st_size, vertex, limits)
    wanted = _wanted(vertex, attributes=attributes)
    if header.order:
        table, warnings = _read_binary(path, header, before, vertex, after, wanted)
    else:
        table, warnings = _read_ascii(path, header, before, vertex, wanted, limits)
    dtype = _dtype(vertex)
    normals = table[:, 3:6].astype(dtype, copy=False) if _NORMALS[0] in wanted[3:4] else None
    types = {item.name: item.type for item in vertex.properties}
    kept = {name: table[:, i].astype(types[name]) for i, name in enumerate(wanted) if i > 2}
    return DecodedCloud(
        table[:, :3].astype(dtype, copy=False),
        "ply",
        warnings,
        normals,
        attributes=kept if attributes else {},
    )


def _around_vertex(header: Header) -> tuple[list[Element], Element, list[Element]]:
    places = [i for i, element in enumerate(header.elements) if element.name == "vertex"]
    if len(places) != 1:
        raise MalformedFileError(
            f"{len(places)} elements called 'vertex' in the header, expected 1"
        )
    place = places[0]
    return header.elements[:place], header.elements[place], header.elements[place + 1 :]


def _check_sizes(header: Header, size: int, vertex: Element, limits: Limits) -> None:
    """All announced rows, even with empty lists, have to fit into the bytes that are there."""
    row = vertex.smallest_row(header.order)
    check_count(vertex.count, row, size - header.size + 1, "element vertex", limits)
    least = sum(e.count * e.smallest_row(header.order) for e in header.elements)
    if least > size - header.size + 1:  # the last line of ASCII need not be ended
        raise TruncatedFileError(
            f"byte {header.size}: the header announces at least {least} bytes, "
            f"{size - header.size} are there"
        )


def _wanted(vertex: Element, *, attributes: bool) -> tuple[str, ...]:
    """Coordinates, then the normal if there is one, then the others if asked for."""
    scalars = [item.name for item in vertex.properties if not item.count_type]
    for name in _XYZ:
        if name not in scalars:
            raise MalformedFileError(f"element vertex has no property {name!r}")
    wanted = _XYZ + _NORMALS if set(_NORMALS) <= set(scalars) else _XYZ
    others = tuple(name for name in scalars if name not in wanted)
    return wanted + others if attributes else wanted


def _read_binary(
    path: Path,
    header: Header,
    before: list[Element],
    vertex: Element,
    after: list[Element],
    wanted: tuple[str, ...],
) -> tuple[NDArray[np.generic], tuple[str, ...]]:
    content, offset = mapped(path), header.size
    for element in before:
        _, offset = read_rows(content, offset, element, header.order, ())
    table, end = read_rows(content, offset, vertex, header.order, wanted)
    left = len(content) - end
    least = sum(element.count * element.smallest_row(header.order) for element in after)
    if left < least:
        raise TruncatedFileError(f"byte {end}: at least {least} bytes expected, {left} are there")
    known = not any(element.has_lists for element in after)
    warnings = (
        (f"{left - least} bytes after the last row are ignored",) if known and left > least else ()
    )
    return table, warnings


def _read_ascii(
    path: Path,
    header: Header,
    before: list[Element],
    vertex: Element,
    wanted: tuple[str, ...],
    limits: Limits,
) -> tuple[NDArray[np.floating], tuple[str, ...]]:
    names = [item.name for item in vertex.properties]
    columns = [names.index(name) for name in wanted]
    if any(item.count_type for item in vertex.properties[: max(columns)]):
        raise MalformedFileError("element vertex has a list before its coordinates, in ASCII")
    skipped = sum(element.count for element in before)
    offset = _skip_lines(path, header.size, skipped, header.lines, limits)
    first = header.lines + skipped + 1
    table = read_columns(path, offset, first, columns, limits, rows=vertex.count)
    warnings: tuple[str, ...] = ()
    if vertex is header.elements[-1] and not ends_with_newline(path):
        warnings = ("the last line is not ended: its last number may have been cut",)
    return table, warnings


def _skip_lines(path: Path, offset: int, count: int, line: int, limits: Limits) -> int:
    with path.open("rb") as file:
        file.seek(offset)
        for number in range(count):
            if not file.readline(limits.max_line_bytes).endswith(b"\n"):
                raise MalformedFileError(
                    f"line {line + number + 1}: ends early or is longer than "
                    f"{limits.max_line_bytes} bytes"
                )
        return file.tell()


def _dtype(vertex: Element) -> np.dtype[np.floating]:
    types = {item.type for item in vertex.properties if item.name in _XYZ}
    return np.dtype(np.float32 if types == {"f4"} else np.float64)
