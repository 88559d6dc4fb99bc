"""Stanford PLY files: ASCII and binary of both byte orders, any elements and properties.

Only the element "vertex" is read; elements before it are skipped.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.announced_rows import AnnouncedRows
from service.formats.column_types import restore_type
from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count, iter_ranges
from service.formats.errors import MalformedFileError, TruncatedFileError, UnsupportedFileError
from service.formats.faces import LARGE_MESH_WARNING
from service.formats.memory_map import map_file
from service.formats.ply.faces import read_faces, skip_lines
from service.formats.ply.header import PlyElement, PlyHeader, parse_header
from service.formats.ply.rows import read_rows
from service.formats.splat import WARNING as SPLAT_WARNING

_MAGIC = b"ply"
_XYZ = ("x", "y", "z")
_NORMALS = ("nx", "ny", "nz")


def sniff(head: bytes) -> bool:
    """Whether the first word is "ply", in letters of either case."""
    return head[:3].lower() == _MAGIC and head[3:4] in (b"\n", b"\r", b" ")


def read(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> DecodedCloud:
    """Read the vertices of a PLY file.

    `attributes` adds their other scalar properties.

    Raises
    ------
    CloudFileError
        The file is malformed; the message names the line or byte.
    """
    header, before, vertex, after = _read_header(path, limits)
    wanted = _select_properties(vertex, attributes=attributes)
    if header.order:
        table, warnings = _read_binary(path, header, before, vertex, after, wanted)
    else:
        rows = _find_rows(path, header, wanted, limits)
        table, warnings = rows.read(limits), rows.warnings(limits)
    cloud = _to_cloud(table, vertex, wanted, attributes=attributes)
    if attributes:
        warnings += _warn_of_lost(header, vertex)
    if not faces:
        return replace(cloud, warnings=warnings)
    triangles, more = read_faces(path, header, limits, warns_of_others=attributes)
    return replace(cloud, warnings=(*warnings, *more), faces=triangles)


def read_pieces(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read` does, in consecutive pieces; `faces` are not kept, which a warning says.

    Raises
    ------
    UnsupportedFileError
        The vertices, or elements before them, have lists.
    """
    header, before, vertex, _ = _read_header(path, limits)
    wanted = _select_properties(vertex, attributes=attributes)
    _refuse_lists([*before, vertex], vertex.count)
    warnings: tuple[str, ...] = ()
    if header.order:
        for table in _iter_binary(path, header, before, vertex, wanted):
            yield _to_cloud(table, vertex, wanted, attributes=attributes)
    else:
        rows = _find_rows(path, header, wanted, limits)
        for numbers in rows.read_pieces(limits):
            yield _to_cloud(numbers, vertex, wanted, attributes=attributes)
        warnings = rows.warnings(limits)
    if attributes or faces:
        others = [element.name[:40] for element in header.elements if element.name != "vertex"]
        has_faces = any(element.name == "face" and element.count for element in header.elements)
        lost = f"elements that are not kept, because the file is large: {', '.join(others[:9])}"
        warnings += (*_warn_of_lost(header, vertex), *((lost,) if others else ()))
        warnings += (LARGE_MESH_WARNING,) if has_faces else ()
    yield DecodedCloud(np.empty((0, 3)), "ply", warnings)


def _read_header(
    path: Path, limits: ReadLimits
) -> tuple[PlyHeader, list[PlyElement], PlyElement, list[PlyElement]]:
    """Read the header, and divide its elements at the vertices."""
    with path.open("rb") as file:
        header = parse_header(file.read(limits.max_header_bytes), limits)
    before, vertex, after = _split_at_vertex(header)
    _check_sizes(header, path.stat().st_size, vertex, limits)
    return header, before, vertex, after


def _to_cloud(
    table: NDArray[np.generic], vertex: PlyElement, wanted: tuple[str, ...], *, attributes: bool
) -> DecodedCloud:
    dtype = _coordinate_type(vertex)
    normals = table[:, 3:6].astype(dtype, copy=False) if _NORMALS[0] in wanted[3:4] else None
    kept: dict[str, NDArray[np.generic]] = {}
    if attributes:
        types = {item.name: item.type for item in vertex.properties}
        named = enumerate(wanted[3:], 3)
        kept = {name: restore_type(table[:, i], types[name]) for i, name in named}
    points = table[:, :3].astype(dtype, copy=False)
    return DecodedCloud(points, "ply", (), normals, attributes=kept)


def _warn_of_lost(header: PlyHeader, vertex: PlyElement) -> tuple[str, ...]:
    """Warn of Gaussian splats, and of lists and coordinate systems, which are not kept."""
    names = {item.name for item in vertex.properties}
    warnings: tuple[str, ...] = (SPLAT_WARNING,) if {"f_dc_0", "rot_0"} <= names else ()
    if header.crs:
        warnings += (f"the coordinate system in the header is not kept: {header.crs!r}",)
    lists = ", ".join(repr(item.name[:40]) for item in vertex.properties if item.count_type)
    return (*warnings, f"lists of the vertices are not kept: {lists}") if lists else warnings


def _iter_binary(
    path: Path,
    header: PlyHeader,
    before: list[PlyElement],
    vertex: PlyElement,
    wanted: tuple[str, ...],
) -> Iterator[NDArray[np.generic]]:
    """Yield the wanted properties of consecutive vertices."""
    start = header.size + sum(item.count * item.min_row_bytes(header.order) for item in before)
    row_bytes = vertex.min_row_bytes(header.order)
    for rows in iter_ranges(vertex.count, row_bytes):
        content = map_file(path, start + rows.start * row_bytes, len(rows) * row_bytes)
        piece = replace(vertex, count=len(rows))
        yield read_rows(content, 0, piece, header.order, wanted)[0]


def _refuse_lists(elements: list[PlyElement], count: int) -> None:
    if any(element.has_lists for element in elements):
        raise UnsupportedFileError(
            f"{count} vertices with lists, or behind lists, are too many for the memory "
            "allowed: save the vertices first, and without lists"
        )


def _split_at_vertex(header: PlyHeader) -> tuple[list[PlyElement], PlyElement, list[PlyElement]]:
    places = [i for i, element in enumerate(header.elements) if element.name == "vertex"]
    if len(places) != 1:
        raise MalformedFileError(
            f"the header has {len(places)} elements called 'vertex'; expected 1"
        )
    place = places[0]
    return header.elements[:place], header.elements[place], header.elements[place + 1 :]


def _check_sizes(header: PlyHeader, size: int, vertex: PlyElement, limits: ReadLimits) -> None:
    """Check that all announced rows, even with empty lists, fit into the file."""
    row = vertex.min_row_bytes(header.order)
    check_count(vertex.count, row, size - header.size + 1, "element vertex", limits)
    needed = sum(e.count * e.min_row_bytes(header.order) for e in header.elements)
    if needed > size - header.size + 1:  # the last line of ASCII may lack its line end
        raise TruncatedFileError(
            f"byte {header.size}: the header announces at least {needed} bytes, "
            f"but only {size - header.size} follow"
        )


def _select_properties(vertex: PlyElement, *, attributes: bool) -> tuple[str, ...]:
    """Return the coordinates, the normal if there is one, and the others if requested."""
    scalars = [item.name for item in vertex.properties if not item.count_type]
    if "packed_position" in scalars:
        raise UnsupportedFileError(
            "the vertices are Gaussian splats as SuperSplat packs them, which are not read: "
            "export them as PLY without compression"
        )
    for name in _XYZ:
        if name not in scalars:
            raise MalformedFileError(
                f"element vertex has no property {name!r}; expected x, y and z"
            )
    wanted = _XYZ + _NORMALS if set(_NORMALS) <= set(scalars) else _XYZ
    others = tuple(name for name in scalars if name not in wanted)
    return wanted + others if attributes else wanted


def _read_binary(
    path: Path,
    header: PlyHeader,
    before: list[PlyElement],
    vertex: PlyElement,
    after: list[PlyElement],
    wanted: tuple[str, ...],
) -> tuple[NDArray[np.generic], tuple[str, ...]]:
    content, offset = map_file(path), header.size
    for element in before:
        _, offset = read_rows(content, offset, element, header.order, ())
    table, end = read_rows(content, offset, vertex, header.order, wanted)
    left = len(content) - end
    needed = sum(element.count * element.min_row_bytes(header.order) for element in after)
    if left < needed:
        raise TruncatedFileError(f"byte {end}: at least {needed} bytes expected, {left} follow")
    is_size_known = not any(element.has_lists for element in after)
    warnings = (
        (f"{left - needed} bytes after the last row are ignored",)
        if is_size_known and left > needed
        else ()
    )
    return table, warnings


def _find_rows(
    path: Path, header: PlyHeader, wanted: tuple[str, ...], limits: ReadLimits
) -> AnnouncedRows:
    """Find the vertices of an ASCII file."""
    before, vertex, after = _split_at_vertex(header)
    names = [item.name for item in vertex.properties]
    columns = [names.index(name) for name in wanted]
    if any(item.count_type for item in vertex.properties[: max(columns)]):
        raise MalformedFileError(
            "element vertex has a list before its coordinates, which ASCII cannot skip; "
            "save the file as binary"
        )
    skipped = sum(element.count for element in before)
    offset = skip_lines(path, header.size, skipped, header.lines, limits)
    rows_after = sum(element.count for element in after)
    return AnnouncedRows.at(
        path, offset, header.lines + skipped + 1, columns, vertex.count, rows_after
    )


def _coordinate_type(vertex: PlyElement) -> np.dtype[np.floating]:
    types = {item.type for item in vertex.properties if item.name in _XYZ}
    return np.dtype(np.float32 if types == {"f4"} else np.float64)
