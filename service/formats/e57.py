"""ASTM E57 files, read by pye57: one or several scans in the common frame of the file."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import (
    DecodedCloud,
    ReadLimits,
    check_count,
    check_density,
    join_pieces,
)
from service.formats.e57_fields import Fields, add_buffers, rotate_normals, select_fields
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    TruncatedFileError,
    UnsupportedFileError,
    short_reason,
)
from service.formats.libraries import import_library
from service.formats.multi_scan import select_scans, to_viewpoints

MAGIC = b"ASTM-E57"
_MAX_XML_BYTES = 16 << 20
_XML_DECLARATION = re.compile(rb"<\?xml[ \t\r\n][^<>]{0,200}\?>")
_XML_ENCODING = re.compile(rb"encoding[ \t\r\n]*=[ \t\r\n]*[\"']([^\"']*)")
_CHUNK_POINTS = 1_000_000
_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")


def read(
    path: Path, limits: ReadLimits, scan: int | None, *, attributes: bool = False
) -> DecodedCloud:
    """Read the points of a scan (counted from 0) or of all scans, moved by their poses.

    Points marked as invalid become NaN, so that they keep their index. `attributes` adds the other
    fields that all of these scans have.

    Raises
    ------
    CloudFileError
        The file is damaged, holds a scan without coordinates, or has no such scan.
    """
    return join_pieces(read_pieces(path, limits, scan, attributes=attributes))


def read_pieces(
    path: Path, limits: ReadLimits, scan: int | None, *, attributes: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read` does, in consecutive pieces; the last has no points, but the warnings."""
    pye57 = import_library("pye57")
    _check_header(path)
    try:
        file = pye57.E57(str(path))
        headers = [file.get_header(i) for i in range(file.scan_count)]
        total = sum(header.point_count for header in headers)
        check_count(total, 0, 0, f"{len(headers)} scans", limits)
        check_density(total, path.stat().st_size, f"{len(headers)} scans")
        wanted, warnings = select_scans(len(headers), scan)
        fields = select_fields([headers[i] for i in wanted]) if attributes else Fields()
        viewpoints = to_viewpoints(_read_pose(headers[i]) for i in wanted)
        for i in wanted:
            for points, columns in _iter_scan(file, headers[i], fields):
                kept = {name: columns[field] for name, field in fields.names.items()}
                yield DecodedCloud(points, "e57", attributes=kept)
        file.close()
    except CloudFileError:
        raise
    except (pye57.libe57.E57Exception, RuntimeError, ValueError, TypeError, KeyError) as error:
        reason = short_reason(error)
        raise MalformedFileError(f"the E57 file cannot be read: {reason}") from None
    empty: dict[str, NDArray[np.generic]] = {
        name: np.empty(0, fields.types[field]) for name, field in fields.names.items()
    }
    yield DecodedCloud(
        np.empty((0, 3)),
        "e57",
        warnings + fields.warnings,
        viewpoints=viewpoints,
        attributes=empty,
    )


def _check_header(path: Path) -> None:
    """Check that the file is complete, and its XML short and without entities."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(48)
        if len(head) < 48:
            raise TruncatedFileError(f"byte {len(head)}: the file ends within the E57 header")
        length, xml_at, xml_length, page = struct.unpack_from("<4Q", head, 16)
        if length != size:
            raise TruncatedFileError(
                f"byte 16: the header announces {length} bytes, the file has {size}"
            )
        if xml_length > _MAX_XML_BYTES:
            raise FileLimitError(
                f"byte 32: {xml_length} bytes of XML; the limit is {_MAX_XML_BYTES}"
            )
        if page != 1024 or not 48 <= xml_at <= size:
            raise MalformedFileError(
                f"byte 24: XML at byte {xml_at} in pages of {page} bytes; "
                "expected pages of 1024 bytes and the XML within the file"
            )
        start = xml_at - xml_at % page
        file.seek(start)
        pages = file.read((xml_length // (page - 4) + 2) * page)
    held = b"".join(pages[i : i + page - 4] for i in range(0, len(pages), page))
    xml = held[xml_at - start :][:xml_length]
    if len(xml) < xml_length:
        raise TruncatedFileError(f"byte {size}: the file ends within its XML")
    _check_xml(xml)
    _check_prototypes(xml)


def _check_xml(xml: bytes) -> None:
    """Check that the XML is UTF-8, as the standard demands, without document type and entities.

    A parser that takes the bytes for another encoding would read other markup than this check.
    """
    declaration = _XML_DECLARATION.match(xml)
    if declaration is None or b"\0" in xml:
        raise MalformedFileError("the XML does not begin with <?xml, or is not in UTF-8")
    encoding = _XML_ENCODING.search(declaration[0])
    if encoding is not None and encoding[1].lower() != b"utf-8":
        raise MalformedFileError(
            f"the XML is in the encoding {encoding[1][:20]!r}; E57 demands UTF-8"
        )
    if re.search(rb"<!\s*(DOCTYPE|ENTITY)", xml):
        raise UnsupportedFileError(
            "the XML declares a document type or entities, which are not read"
        )


def _check_prototypes(xml: bytes) -> None:
    """Check that the points of each scan have a prototype: libE57 crashes without one."""
    try:
        root = ElementTree.fromstring(xml)  # noqa: S314  without document type and entities
    except ElementTree.ParseError as error:
        raise MalformedFileError(f"the XML is not well-formed: {short_reason(error)}") from None
    points = [item for item in root.iter() if item.tag.rpartition("}")[2] == "points"]
    for number, item in enumerate(points):
        if not any(child.tag.rpartition("}")[2] == "prototype" and len(child) for child in item):
            raise MalformedFileError(
                f"the points of scan {number} have no prototype, which lists their fields"
            )


def _iter_scan(
    file: Any, header: Any, extra: Fields
) -> Iterator[tuple[NDArray[np.float64], dict[str, NDArray[np.generic]]]]:
    """Yield consecutive points of a scan in the frame of the file, and their other fields."""
    fields = set(header.point_fields)
    if fields.issuperset(_CARTESIAN):
        names, invalid = _CARTESIAN, "cartesianInvalidState"
    elif fields.issuperset(_SPHERICAL):
        names, invalid = _SPHERICAL, "sphericalInvalidState"
    else:
        raise UnsupportedFileError(
            f"a scan has the fields {sorted(fields)[:9]}; expected cartesianX, Y, Z or "
            "sphericalRange, Azimuth, Elevation"
        )
    columns = [*names, invalid] if invalid in fields else [*names]
    capacity = min(_CHUNK_POINTS, max(1, header.point_count))
    data, buffers = file.make_buffers(columns, capacity)
    add_buffers(file.image_file, extra, capacity, data, buffers)
    reader, count = header.points.reader(buffers), 0
    while got := reader.read():
        points = np.stack([data[name][:got] for name in names], axis=1).astype(np.float64)
        if invalid in data:
            points[data[invalid][:got] != 0] = np.nan
        kept: dict[str, NDArray[np.generic]] = {
            name: data[name][:got].astype(kind) for name, kind in extra.types.items()
        }
        if names is _SPHERICAL:
            points = _to_cartesian(points)
        if header.has_pose():
            rotation = header.rotation_matrix
            points = points @ rotation.T + header.translation
            rotate_normals(kept, rotation)
        count += got
        yield points, kept
    if count != header.point_count:
        raise TruncatedFileError(f"a scan holds {count} of {header.point_count} announced points")


def _read_pose(header: Any) -> NDArray[np.float64] | None:
    """(4, 4) pose of a scan that has a grid or a pose: others may be merged clouds."""
    T = np.eye(4)
    if header.has_pose():
        T[:3, :3], T[:3, 3] = header.rotation_matrix, header.translation
    elif not {"rowIndex", "columnIndex"} <= set(header.point_fields):
        return None
    return T


def _to_cartesian(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert range, azimuth and elevation to x, y, z (ASTM E2807, 8.4.4.2)."""
    distance, azimuth, elevation = points.T
    flat = distance * np.cos(elevation)
    return np.stack(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), distance * np.sin(elevation)], axis=1
    )
