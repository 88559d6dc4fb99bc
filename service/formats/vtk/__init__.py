"""VTK files: points, faces and attributes of poly data and of grids; here legacy files (.vtk)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, iter_ranges, join_pieces
from service.formats.errors import CloudFileError
from service.formats.faces import (
    LARGE_MESH_WARNING,
    check_face_count,
    check_faces,
    triangulate,
)
from service.formats.vtk.cells import (
    cut_cells,
    cut_strips,
    split_lists,
    split_offsets,
)
from service.formats.vtk.columns import name_columns
from service.formats.vtk.layout import CellLists, Column, Layout, read_layout

MAGIC = b"# vtk DataFile"
_CORNERS_PER_FACE = 3
"""Numbers of the list of a face, at least."""


def read(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> DecodedCloud:
    """Read the points in ASCII or binary, their attributes, and the faces.

    Raises
    ------
    CloudFileError
        The file is damaged, or its data set has no points of its own.
    """
    layout = read_layout(path, limits, is_whole=attributes or faces)
    cloud = join_pieces(_iter_points(layout, attributes=attributes))
    if not faces:
        return replace(cloud, warnings=layout.warnings)
    try:
        triangles = check_faces(_read_triangles(layout, cloud, limits), layout.count)
    except CloudFileError as error:
        lost = f"the faces are not kept: {error}"
        return replace(cloud, warnings=(*layout.warnings, lost))
    return replace(cloud, warnings=layout.warnings, faces=triangles if len(triangles) else None)


def read_pieces(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read` does, in consecutive pieces; `faces` are not kept, which a warning says."""
    layout = read_layout(path, limits, is_whole=attributes or faces)
    last = DecodedCloud(np.empty((0, 3)), "vtk")
    for last in _iter_points(layout, attributes=attributes):
        yield last
    has_faces = bool(set(layout.cells) - {"VERTICES", "LINES"})
    warnings = (*layout.warnings, *((LARGE_MESH_WARNING,) if faces and has_faces else ()))
    yield DecodedCloud(last.points[:0], "vtk", warnings)


def _iter_points(layout: Layout, *, attributes: bool) -> Iterator[DecodedCloud]:
    """Yield consecutive points, at least one piece."""
    columns = [layout.points, *(layout.attributes if attributes else [])]
    cursors = [layout.start.copy(column.at) for column in columns]
    row_bytes = 8 * sum(column.width for column in columns)
    target = np.float32 if layout.points.kind == np.dtype(">f4") else np.float64
    for rows in iter_ranges(layout.count, row_bytes) if layout.count else [range(0)]:
        points, *others = (
            cursor.rows(len(rows), column.width, column.kind)
            for cursor, column in zip(cursors, columns, strict=True)
        )
        names = (column.name for column in columns[1:])
        normals, kept = name_columns(zip(names, others, strict=True))
        yield DecodedCloud(points.astype(target, copy=False), "vtk", (), normals, attributes=kept)


def _read_triangles(layout: Layout, cloud: DecodedCloud, limits: ReadLimits) -> NDArray[np.int64]:
    """Read polygons, strips, and flat and solid cells."""
    parts = [np.empty((0, 3), np.int64)]
    for keyword, cells in layout.cells.items():
        if keyword in ("VERTICES", "LINES"):
            continue
        corners, sizes = _read_lists(layout, cells, limits)
        if keyword == "CELLS":
            types = _integers(layout, layout.cell_types, limits)
            parts.append(cut_cells(corners, sizes, types, cloud.points))
        else:
            parts.append((triangulate if keyword == "POLYGONS" else cut_strips)(corners, sizes))
    return np.concatenate(parts)


def _read_lists(
    layout: Layout, cells: CellLists, limits: ReadLimits
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the corners of all cells, and their number in each."""
    numbers = _integers(layout, cells.numbers, limits)
    if cells.corners is None:
        return split_lists(numbers, cells.count)
    return split_offsets(_integers(layout, cells.corners, limits), numbers[1:])


def _integers(layout: Layout, column: Column | None, limits: ReadLimits) -> NDArray[np.int64]:
    if column is None:
        return np.empty(0, np.int64)
    check_face_count(layout.count, column.rows // _CORNERS_PER_FACE, limits)
    numbers = layout.start.copy(column.at).rows(column.rows, 1, column.kind)
    return numbers.ravel().astype(np.int64)
