"""XML files of VTK (.vtp, .vtu, .vts): points, faces and attributes of poly data and of grids."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import (
    DecodedCloud,
    ReadLimits,
    check_count,
    check_whole_size,
)
from service.formats.errors import (
    CloudFileError,
    MalformedFileError,
    UnsupportedFileError,
    short_reason,
)
from service.formats.faces import check_faces, triangulate
from service.formats.vtk.cells import cut_cells, cut_strips, split_offsets
from service.formats.vtk.columns import name_columns
from service.formats.vtk.xml_arrays import ArrayReader

_KINDS = ("PolyData", "UnstructuredGrid", "StructuredGrid")
_APPENDED = re.compile(rb"<AppendedData[^>]{0,200}>[ \t\r\n]{0,100}_")


def sniff(head: bytes) -> bool:
    """Whether it is XML with the root element VTKFile."""
    start = head.lstrip()[:2000]
    return start.startswith(b"<") and b"<VTKFile" in start


def read(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> DecodedCloud:
    """Read the points of all pieces, their attributes, and the faces.

    Raises
    ------
    CloudFileError
        The file is damaged, or of a kind without points of its own.
    """
    check_whole_size(path, limits)
    content = path.read_bytes()
    found = _APPENDED.search(content)
    root = _parse(content if found is None else content[: found.start()] + b"</VTKFile>")
    kind = root.get("type", "")
    if kind not in _KINDS:
        raise UnsupportedFileError(
            f"VTK of type {kind[:40]!r}; expected one of {', '.join(_KINDS)}: save it as poly data"
        )
    appended = b"" if found is None else content[found.end() :]
    is_raw = found is not None and b'"raw"' in found[0]
    reader = ArrayReader(root, appended, limits, is_raw=is_raw)
    pieces = list(root.iter("Piece"))
    places = [item for piece in pieces for item in piece.findall("Points/DataArray")]
    if not places:
        raise MalformedFileError("the file has no points")
    points = [_read_points(reader, item, limits) for item in places]
    cloud = DecodedCloud(np.concatenate(points), "vtp")
    if attributes:
        cloud = _add_attributes(cloud, reader, pieces)
    return _add_faces(cloud, reader, pieces, [len(part) for part in points]) if faces else cloud


def _read_points(
    reader: ArrayReader, item: ElementTree.Element, limits: ReadLimits
) -> NDArray[np.floating]:
    if item.get("NumberOfComponents") != "3":
        raise MalformedFileError("points of other than three numbers")
    points = reader.read(item, 3)
    check_count(len(points), 0, 0, "the points", limits)
    return points.astype(np.float32 if points.dtype == np.float32 else np.float64, copy=False)


def _add_attributes(
    cloud: DecodedCloud, reader: ArrayReader, pieces: list[ElementTree.Element]
) -> DecodedCloud:
    """Add the arrays that all pieces have; those that cannot be read are named."""
    parts: dict[str, list[NDArray[np.generic]]] = {}
    lost: list[str] = []
    for item in (item for piece in pieces for item in piece.findall("PointData/DataArray")):
        name = item.get("Name", "")
        try:
            width = int(item.get("NumberOfComponents") or 1)
            parts.setdefault(name, []).append(reader.read(item, max(1, width)))
        except (CloudFileError, ValueError) as error:
            lost.append(f"the attribute {name[:40]!r} is not kept: {short_reason(error)}")
    arrays = [
        (name, np.concatenate(values))
        for name, values in parts.items()
        if len({part.shape[1] for part in values}) == 1
        and sum(map(len, values)) == len(cloud.points)
    ]
    normals, kept = name_columns(arrays)
    return replace(cloud, normals=normals, attributes=kept, warnings=tuple(dict.fromkeys(lost)))


def _add_faces(
    cloud: DecodedCloud,
    reader: ArrayReader,
    pieces: list[ElementTree.Element],
    counts: list[int],
) -> DecodedCloud:
    """Add polygons, strips, and flat and solid cells; a warning says where they are damaged."""
    parts, first = [np.empty((0, 3), np.int64)], 0
    try:
        for piece, count in zip(pieces, counts, strict=True):
            found = [
                cells for name in ("Polys", "Strips", "Cells") for cells in piece.findall(name)
            ]
            mine = cloud.points[first : first + count]
            parts += [first + _read_cells(reader, cells, mine) for cells in found]
            first += count
    except (CloudFileError, ValueError) as error:
        text = f"the faces are not kept: {short_reason(error)}"
        return replace(cloud, warnings=(*cloud.warnings, text))
    faces = np.concatenate(parts)
    return replace(cloud, faces=faces if len(faces) else None)


def _read_cells(
    reader: ArrayReader, cells: ElementTree.Element, points: NDArray[np.floating]
) -> NDArray[np.int64]:
    """Read the triangles (F, 3) of the cells of a piece of these points."""
    arrays = {
        item.get("Name", ""): reader.read(item, 1).ravel().astype(np.int64)
        for item in cells.findall("DataArray")
        if item.get("Name") in ("connectivity", "offsets", "types")
    }
    empty = np.empty(0, np.int64)
    corners, sizes = split_offsets(arrays.get("connectivity", empty), arrays.get("offsets", empty))
    if cells.tag == "Cells":
        return cut_cells(corners, sizes, arrays.get("types", empty), points)
    cut = triangulate if cells.tag == "Polys" else cut_strips
    return check_faces(cut(corners, sizes), len(points))


def _parse(xml: bytes) -> ElementTree.Element:
    """Parse XML without document type and entities."""
    if re.search(rb"<!\s*(DOCTYPE|ENTITY)", xml) or b"\0" in xml[:1000]:
        raise UnsupportedFileError("the XML declares a document type, or is not in UTF-8")
    try:
        return ElementTree.fromstring(xml)  # noqa: S314  without document type and entities
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise MalformedFileError(f"the XML is not well-formed: {short_reason(error)}") from None
