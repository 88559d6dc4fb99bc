"""STL files, binary and ASCII: the corners of their triangles."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count, iter_ranges
from service.formats.errors import MalformedFileError, TruncatedFileError
from service.formats.faces import LARGE_MESH_WARNING
from service.formats.memory_map import map_file
from service.formats.text_block import TextBlock
from service.formats.text_cleaner import Dialect, TableCleaner
from service.formats.text_table import iter_columns, read_columns

_HEADER_BYTES = 84
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_SNIFFED_TRIANGLES = 20
_SNIFFED_BYTES = 4096
_MIN_COORDINATE = 1e-30
"""Magnitude below which a number is no rounding noise, but an integer read as float."""
_MAX_COORDINATE = 1e12
"""Magnitude that a coordinate may have; a quarter of random floats are in the range."""
_KEYWORD = re.compile(rb"^[ \t]*(vertex)[ \t]", re.IGNORECASE | re.MULTILINE)
_XYZ = (1, 2, 3)
"""Columns of the coordinates, behind the keyword."""


def sniff(head: bytes) -> bool:
    """Whether it is an ASCII solid, or the first triangles of a binary one are plausible."""
    if b"\0" not in head:  # text, or a binary file of more triangles than are read
        return _is_ascii(head)
    body = head[_HEADER_BYTES:]
    rows = min(len(body) // _TRIANGLE.itemsize, _SNIFFED_TRIANGLES)
    if rows == 0 or struct.unpack_from("<I", head, 80)[0] < rows:
        return False
    triangles = np.frombuffer(body, _TRIANGLE, rows)
    corners = triangles["corners"].reshape(rows, 9)
    normals = np.nan_to_num(triangles["normal"])  # of triangles without area
    with np.errstate(invalid="ignore"):
        sizes = np.abs(np.concatenate([normals, corners], axis=1))
        plausible = (sizes < _MAX_COORDINATE) & ((sizes > _MIN_COORDINATE) | (sizes == 0))
    return bool(plausible.all() and (corners != 0).any())


def read(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> DecodedCloud:
    """Read the corners, equal ones merged; `attributes` warns of those that are not kept.

    Raises
    ------
    CloudFileError
        The file is damaged; the message names the line or byte.
    """
    warnings: tuple[str, ...] = ()
    if keyword := _find_keyword(path):
        dialect = Dialect(keyword=keyword)
        cleaner = TableCleaner(dialect, _XYZ)
        corners = read_columns(path, 0, 1, _XYZ, limits, dialect=dialect, cleaner=cleaner)
        warnings = cleaner.warnings()
    else:
        count = _count_triangles(path, limits)
        corners = _read_triangles(path, range(count))
        warnings = _warn_of_colors(path, count) if attributes else ()
    if len(corners) == 0 or len(corners) % 3:
        where = f"lines begin with {keyword!r}" if keyword else "corners"
        raise MalformedFileError(f"{len(corners)} {where}; expected three for each triangle")
    points, places = _merge_equal(corners)
    return DecodedCloud(points, "stl", warnings, faces=places.reshape(-1, 3) if faces else None)


def read_pieces(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> Iterator[DecodedCloud]:
    """Read in consecutive pieces; equal corners are not merged, and `faces` are not kept."""
    warnings: tuple[str, ...] = (LARGE_MESH_WARNING,) if faces else ()
    if keyword := _find_keyword(path):
        text, dialect = TextBlock(path, 0, path.stat().st_size, 1), Dialect(keyword=keyword)
        cleaner = TableCleaner(dialect, _XYZ)
        for corners in iter_columns(text, _XYZ, limits, dialect=dialect, cleaner=cleaner):
            yield DecodedCloud(corners, "stl")
        warnings = cleaner.warnings() + warnings
    else:
        count = _count_triangles(path, limits)
        for triangles in iter_ranges(count, _TRIANGLE.itemsize):
            yield DecodedCloud(_read_triangles(path, triangles), "stl")
        warnings += _warn_of_colors(path, count) if attributes else ()
    yield DecodedCloud(np.empty((0, 3)), "stl", warnings)


def _is_ascii(head: bytes) -> bool:
    """Whether it begins with a solid of facets, in letters of either case."""
    return head.lstrip()[:5].lower() == b"solid" and b"facet" in head.lower()


def _find_keyword(path: Path) -> str:
    """Return the first word of the lines of corners of an ASCII file; nothing for binary ones."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_SNIFFED_BYTES)
        file.seek(max(0, size - _SNIFFED_BYTES))
        tail = file.read()
    if not _is_ascii(head):
        return ""
    if b"endsolid" not in tail.lower():
        raise TruncatedFileError(f"byte {size}: the file ends before 'endsolid'")
    found = _KEYWORD.search(head)
    return "vertex" if found is None else found[1].decode()


def _count_triangles(path: Path, limits: ReadLimits) -> int:
    """Read the number of triangles of a binary file, and check that they fit into it."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEADER_BYTES)
    if len(head) < _HEADER_BYTES:
        raise TruncatedFileError(f"byte {size}: the file ends within its header")
    (count,) = struct.unpack_from("<I", head, 80)
    check_count(3 * count, 0, 0, "byte 80", limits)
    if _HEADER_BYTES + _TRIANGLE.itemsize * count > size:
        raise TruncatedFileError(f"byte 80: {count} triangles do not fit into {size} bytes")
    return int(count)


def _read_triangles(path: Path, rows: range) -> NDArray[np.float64]:
    """Return the corners (3 N, 3) of consecutive triangles."""
    if len(rows) == 0:
        return np.empty((0, 3))
    return _map_triangles(path, rows)["corners"].astype(np.float64).reshape(-1, 3)


def _map_triangles(path: Path, rows: range) -> NDArray[np.void]:
    """Map consecutive triangles, of which there are some."""
    size = _TRIANGLE.itemsize
    content = map_file(path, _HEADER_BYTES + rows.start * size, len(rows) * size)
    return np.frombuffer(content, _TRIANGLE)


def _warn_of_colors(path: Path, count: int) -> tuple[str, ...]:
    """Name the colours and other numbers behind the triangles, which are not kept."""
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    found = 0
    for rows in iter_ranges(count, _TRIANGLE.itemsize):
        found += int(np.count_nonzero(_map_triangles(path, rows)["attribute"]))
    if b"COLOR=" in header:
        return ("the colours of the mesh and its triangles (Materialise) are not kept",)
    if not found:
        return ()
    return (f"the colours (VisCAM) or other numbers of {found} triangles are not kept",)


def _merge_equal(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Remove repeated corners; the first of each is kept, in order.

    Returns
    -------
    tuple[NDArray[np.float64], NDArray[np.int64]]
        The points, and the place of each given corner among them.
    """
    _, first, inverse = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    places = np.empty(len(first), np.int64)
    places[np.argsort(first)] = np.arange(len(first))
    return corners[np.sort(first)], places[inverse.ravel()]
