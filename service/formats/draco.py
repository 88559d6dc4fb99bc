"""Draco files (.drc), decoded by DracoPy: points, faces, normals, colours."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB
from service.formats.decoded_cloud import (
    DecodedCloud,
    ReadLimits,
    check_count,
    check_density,
    check_whole_size,
)
from service.formats.errors import (
    MalformedFileError,
    TruncatedFileError,
    UnsupportedFileError,
    short_reason,
)
from service.formats.faces import check_face_count, check_faces
from service.formats.libraries import import_library

MAGIC = b"DRACO"
_HEADER_BYTES = 11
_IS_MESH = 1
_HAS_METADATA = 0x8000
_MIN_DENSE_POINTS = 100_000
"""Points up to which their number is not checked against the size of the file; Draco allocates
many numbers for each."""
_MAX_ATTRIBUTES = 64
_USUAL_TYPES = (0, 1, 2, 3)
"""Numbers of Draco for positions, normals, colours and texture coordinates."""


def sniff(head: bytes) -> bool:
    """Whether it begins as Draco demands."""
    return head.startswith(MAGIC)


def read(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> DecodedCloud:
    """Read the points of a cloud or mesh, and its normals; `attributes` adds colours.

    Raises
    ------
    CloudFileError
        The file is damaged.
    """
    check_whole_size(path, limits)
    content = path.read_bytes()
    mesh = decode_draco(content, limits)
    points = np.asarray(mesh.points)
    normals = _rows(mesh, "normals", len(points))
    triangles = np.empty((0, 3), np.int64)
    if faces and content[7] == _IS_MESH:
        triangles = check_faces(np.asarray(mesh.faces, np.int64).reshape(-1, 3), len(points))
    kind = np.float32 if points.dtype == np.float32 else np.float64
    return DecodedCloud(
        points.astype(kind, copy=False),
        "draco",
        (),
        normals,
        attributes=_attributes(mesh, len(points)) if attributes else {},
        faces=triangles if len(triangles) else None,
    )


def decode_draco(content: bytes, limits: ReadLimits) -> Any:
    """Decode a cloud or mesh by DracoPy.

    Raises
    ------
    MalformedFileError
        The content is damaged, or has no points.
    """
    draco = import_library("DracoPy")
    _check_header(content)
    try:
        mesh = draco.decode(content)
        points = np.asarray(mesh.points)
    except MemoryError:
        raise
    except Exception as error:  # noqa: BLE001  DracoPy raises nearly anything on damaged files
        raise MalformedFileError(f"Draco cannot be decoded: {short_reason(error)}") from None
    if points.ndim != 2 or points.shape[1] != 3:
        raise MalformedFileError(f"the positions have the shape {points.shape}; expected (N, 3)")
    check_density(len(points), len(content), "the points")
    check_count(len(points), 0, 0, "the points", limits)
    if content[7] == _IS_MESH:
        check_face_count(len(points), len(mesh.faces), limits)
    return mesh


def _check_header(content: bytes) -> None:
    """Check the kind of geometry, and the number of points of a cloud, which Draco allocates."""
    if len(content) < _HEADER_BYTES + 4:
        raise TruncatedFileError(f"byte {len(content)}: the data ends within the Draco header")
    _, geometry, _, flags, count = struct.unpack_from("<7sBBHI", content)
    if geometry > _IS_MESH:
        raise MalformedFileError(f"byte 7: geometry {geometry}; expected 0 (points) or 1 (mesh)")
    if geometry == _IS_MESH:
        return
    if flags & _HAS_METADATA:
        raise UnsupportedFileError(
            "byte 9: points with metadata, which is not read: encode them without"
        )
    check_density(count, len(content), f"byte {_HEADER_BYTES}", _MIN_DENSE_POINTS)


def _rows(mesh: Any, name: str, count: int) -> NDArray[np.floating] | None:
    """Return an attribute of three numbers for each point, if there is one."""
    values = getattr(mesh, name, None)
    if values is None or np.shape(values) != (count, 3):
        return None
    return np.asarray(values, np.float32)


def _attributes(mesh: Any, count: int) -> dict[str, NDArray[np.generic]]:
    """Return the colours, and the numbers of other attributes."""
    kept: dict[str, NDArray[np.generic]] = {}
    colors = getattr(mesh, "colors", None)
    if colors is not None and np.ndim(colors) == 2 and len(colors) == count:
        kept |= dict(zip(RGB, np.asarray(colors).T[:3], strict=False))
    for item in list(getattr(mesh, "attributes", ()))[:_MAX_ATTRIBUTES]:
        values = np.asarray(item["data"])
        if item.get("attribute_type") in _USUAL_TYPES or len(values) != count:
            continue
        name = str(item.get("name") or f"attribute_{item['unique_id']}")
        columns = values.reshape(count, -1).T if count else values[:0]
        names = [name] if len(columns) == 1 else [f"{name}_{i}" for i in range(len(columns))]
        kept |= dict(zip(names, columns, strict=True))
    return kept
