"""Meshes (STL, OBJ, OFF, glTF): their vertices and faces."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB
from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import (
    MalformedFileError,
    TruncatedFileError,
    short_reason,
)
from service.formats.faces import check_faces
from service.formats.libraries import import_library
from service.formats.mesh.gltf import check_gltf
from service.formats.mesh.gltf_draco import without_draco

_STL_HEADER_BYTES, _STL_ROW_BYTES = 84, 50
_SNIFFED_TRIANGLES = 20
_MIN_COORDINATE = 1e-30
"""Magnitude below which a number is no rounding noise, but an integer read as float."""
_MAX_COORDINATE = 1e12
"""Magnitude that a coordinate may have; a quarter of random floats are in the range."""


def sniff_stl(head: bytes) -> bool:
    """Whether it is an ASCII solid, or the first triangles of a binary one are plausible."""
    if b"\0" not in head:  # text, or a binary file of more triangles than are read
        return _is_ascii_stl(head)
    body = head[_STL_HEADER_BYTES:]
    rows = min(len(body) // _STL_ROW_BYTES, _SNIFFED_TRIANGLES)
    if rows == 0 or struct.unpack_from("<I", head, 80)[0] < rows:
        return False
    layout = np.dtype([("floats", "<f4", 12), ("attribute", "<u2")])
    floats = np.frombuffer(body, layout, rows)["floats"]
    with np.errstate(invalid="ignore"):
        sizes = np.abs(floats)
        plausible = (sizes < _MAX_COORDINATE) & ((sizes > _MIN_COORDINATE) | (sizes == 0))
    return bool(plausible.all() and (floats[:, 3:] != 0).any())


def _is_ascii_stl(head: bytes) -> bool:
    """Whether it begins with a solid of facets, in letters of either case."""
    return head.lstrip()[:5].lower() == b"solid" and b"facet" in head.lower()


def read_stl(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> DecodedCloud:
    """Read the corners of an STL file, equal ones merged."""
    _check_stl(path, limits)
    return _read_mesh(path, limits, "stl", attributes=attributes, faces=faces)


def read_gltf(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> DecodedCloud:
    """Read the meshes of a glTF 2.0 file (.glb, or .gltf with embedded data), placed by nodes."""
    with without_draco(path, limits) as plain:
        kind = check_gltf(plain, limits)
        return _read_mesh(plain, limits, kind, attributes=attributes, faces=faces)


def _read_mesh(
    path: Path, limits: ReadLimits, kind: str, *, attributes: bool, faces: bool
) -> DecodedCloud:
    points, triangles, kept = _load(path, kind)
    if len(points) == 0:
        raise MalformedFileError("the mesh has no vertices")
    check_count(len(points), 0, 0, "the vertices", limits)
    if kind == "stl":
        points, places = _unique_rows(points)
        triangles = places[triangles]
    triangles = check_faces(triangles, len(points))
    return DecodedCloud(
        points,
        "gltf" if kind == "glb" else kind,
        attributes=kept if attributes else {},
        faces=triangles if faces and len(triangles) else None,
    )


def _load(
    path: Path, kind: str
) -> tuple[NDArray[np.float64], NDArray[np.int64], dict[str, NDArray[np.generic]]]:
    """Load vertices (V, 3), triangles (T, 3) and attributes of all parts, placed in the scene."""
    trimesh = import_library("trimesh")
    vertices, faces = [np.empty((0, 3))], [np.empty((0, 3), np.int64)]
    attributes: list[dict[str, NDArray[np.generic]]] = []
    try:
        scene: Any = trimesh.load_scene(
            io.BytesIO(path.read_bytes()),
            file_type=kind,
            resolver={},  # knows no other file
            process=False,
            skip_materials=True,
        )
        for part in scene.dump():
            if hasattr(part, "faces"):
                corners = np.asarray(part.faces, np.int64).reshape(-1, 3)
                faces.append(corners + sum(map(len, vertices)))
            vertices.append(np.asarray(part.vertices, np.float64).reshape(-1, 3))
            attributes.append(_part_attributes(part, len(vertices[-1])))
    except MemoryError:
        raise
    except Exception as error:  # noqa: BLE001  trimesh raises nearly anything on damaged files
        raise MalformedFileError(f"the mesh cannot be read: {short_reason(error)}") from None
    first = attributes[0] if attributes else {}
    names = [name for name in first if all(name in part for part in attributes)]
    kept = {name: np.concatenate([part[name] for part in attributes]) for name in names}
    return np.concatenate(vertices), np.concatenate(faces), kept


def _part_attributes(part: Any, count: int) -> dict[str, NDArray[np.generic]]:
    """Return the colours and the attributes of one number for each vertex."""
    found: dict[str, NDArray[np.generic]] = {}
    if part.visual.kind == "vertex" and len(part.visual.vertex_colors) == count:
        found |= dict(zip(RGB, np.asarray(part.visual.vertex_colors).T[:3], strict=True))
    for name, column in getattr(part, "vertex_attributes", {}).items():
        values = np.asarray(column)
        if values.shape in ((count,), (count, 1)) and values.dtype.kind in "biuf":
            found[str(name).removeprefix("_")] = values.reshape(-1)
    return found


def _unique_rows(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Remove repeated rows; the first of each is kept, in order.

    Returns
    -------
    tuple[NDArray[np.float64], NDArray[np.int64]]
        The rows, and the place of each given row among them.
    """
    _, first, inverse = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    places = np.empty(len(first), np.int64)
    places[np.argsort(first)] = np.arange(len(first))
    return vertices[np.sort(first)], places[inverse.ravel()]


def _check_stl(path: Path, limits: ReadLimits) -> None:
    """Check that a binary file holds the announced triangles, and that an ASCII file ends."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(1024)
        file.seek(max(0, size - 1024))
        tail = file.read()
    if _is_ascii_stl(head):
        if b"endsolid" not in tail.lower():
            raise TruncatedFileError(f"byte {size}: the file ends before 'endsolid'")
        return
    count = struct.unpack_from("<I", head, 80)[0] if len(head) >= _STL_HEADER_BYTES else 0
    check_count(3 * count, 0, 0, "byte 80", limits)
    if _STL_HEADER_BYTES + _STL_ROW_BYTES * count > size:
        raise TruncatedFileError(f"byte 80: {count} triangles do not fit into {size} bytes")
