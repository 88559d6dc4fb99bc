"""Meshes (STL, OBJ, OFF, glTF): their vertices, or samples of their surface."""

from __future__ import annotations

import io
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB
from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import (
    FileLimitError,
    MalformedFileError,
    TruncatedFileError,
    short_reason,
)
from service.formats.faces import check_faces
from service.formats.libraries import import_library
from service.formats.mesh import text as mesh_text
from service.formats.mesh.gltf import check_gltf
from service.formats.mesh.gltf_draco import without_draco

SEED = 0
"""Seed of the surface samples: the same file gives the same points."""
_STL_HEADER_BYTES, _STL_ROW_BYTES = 84, 50
_SNIFFED_TRIANGLES = 20
_MIN_COORDINATE = 1e-30
"""Magnitude below which a number is no rounding noise, but an integer read as float."""
_MAX_COORDINATE = 1e12
"""Magnitude that a coordinate may have; a quarter of random floats are in the range."""


def sniff_stl(head: bytes) -> bool:
    """Whether it is an ASCII solid, or the first triangles of a binary one are plausible."""
    if b"\0" not in head:  # text, or a binary file of more triangles than are read
        return head.lstrip().startswith(b"solid") and b"facet" in head
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


def read_stl(
    path: Path, limits: ReadLimits, surface_samples: int | None, *, attributes: bool = False
) -> DecodedCloud:
    """Read an STL file: its corners, equal ones merged, or surface samples."""
    _check_stl(path, limits)
    return _read_mesh(path, limits, "stl", surface_samples, attributes=attributes)


def read_obj(
    path: Path, limits: ReadLimits, surface_samples: int | None, *, attributes: bool = False
) -> DecodedCloud:
    """Read an OBJ file: the vertices in the order of the file, or surface samples."""
    vertices = mesh_text.read_obj(path, limits, attributes=attributes)
    return vertices if surface_samples is None else _read_mesh(path, limits, "obj", surface_samples)


def read_off(
    path: Path, limits: ReadLimits, surface_samples: int | None, *, attributes: bool = False
) -> DecodedCloud:
    """Read an OFF file: the vertices in the order of the file, or surface samples."""
    vertices = mesh_text.read_off(path, limits, attributes=attributes)
    return vertices if surface_samples is None else _read_mesh(path, limits, "off", surface_samples)


def read_gltf(
    path: Path, limits: ReadLimits, surface_samples: int | None, *, attributes: bool = False
) -> DecodedCloud:
    """Read the meshes of a glTF 2.0 file (.glb, or .gltf with embedded data), placed by nodes."""
    with without_draco(path, limits) as plain:
        kind = check_gltf(plain, limits)
        return _read_mesh(plain, limits, kind, surface_samples, attributes=attributes)


def _read_mesh(
    path: Path,
    limits: ReadLimits,
    kind: str,
    surface_samples: int | None,
    *,
    attributes: bool = False,
) -> DecodedCloud:
    name = "gltf" if kind == "glb" else kind
    vertices, faces, kept = _load(path, kind)
    if len(vertices) == 0:
        raise MalformedFileError("the mesh has no vertices")
    check_count(len(vertices), 0, 0, "the vertices", limits)
    if surface_samples is None:
        points = vertices
        if kind == "stl":
            points, places = _unique_rows(vertices)
            faces = places[faces]
        cloud = DecodedCloud(
            points, name, ("the vertices are read; set 'surface_samples' to sample the surface",)
        )
        if not attributes:
            return cloud
        faces = check_faces(faces, len(points))
        return replace(cloud, attributes=kept, faces=faces if len(faces) else None)
    if surface_samples > limits.max_points:
        raise FileLimitError(
            f"surface_samples is {surface_samples}; the limit is {limits.max_points} points"
        )
    points, normals = _sample_surface(vertices, faces, surface_samples)
    return DecodedCloud(points, name, (), normals)


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


def _sample_surface(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sample points evenly by area, with the normals of their triangles."""
    trimesh = import_library("trimesh")
    sampling = import_library("trimesh.sample")
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise MalformedFileError("a triangle refers to a vertex that does not exist")
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    if not (np.isfinite(mesh.area) and mesh.area > 0):
        raise MalformedFileError(
            f"the {len(faces)} triangles have the area {mesh.area}: nothing to sample; "
            "leave surface_samples out to read the vertices"
        )
    points, triangles = sampling.sample_surface(mesh, count, seed=SEED)
    return np.asarray(points, np.float64), np.asarray(mesh.face_normals[triangles], np.float64)


def _check_stl(path: Path, limits: ReadLimits) -> None:
    """Check that a binary file holds the announced triangles, and that an ASCII file ends."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(1024)
        file.seek(max(0, size - 1024))
        tail = file.read()
    if head.lstrip().startswith(b"solid") and b"facet" in head:
        if b"endsolid" not in tail:
            raise TruncatedFileError(f"byte {size}: the file ends before 'endsolid'")
        return
    count = struct.unpack_from("<I", head, 80)[0] if len(head) >= _STL_HEADER_BYTES else 0
    check_count(3 * count, 0, 0, "byte 80", limits)
    if _STL_HEADER_BYTES + _STL_ROW_BYTES * count > size:
        raise TruncatedFileError(f"byte 80: {count} triangles do not fit into {size} bytes")
