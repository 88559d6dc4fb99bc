"""Meshes (STL, OBJ, OFF, glTF): their vertices and faces; here glTF."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB
from service.formats.decoded_cloud import (
    DecodedCloud,
    ReadLimits,
    check_count,
    check_whole_size,
)
from service.formats.errors import CloudFileError, MalformedFileError, short_reason
from service.formats.faces import check_faces
from service.formats.libraries import import_library
from service.formats.mesh.gltf import check_gltf
from service.formats.mesh.gltf_draco import without_draco
from service.formats.mesh.gltf_parts import COLOR, NORMAL, dequantize, rewrite_parts

_NORMALS = ("nx", "ny", "nz")
_KNOWN = {"COLOR_0": RGB[0], "NORMAL": _NORMALS[0]}
"""Names of glTF, and the first attribute that is made of each."""


def read_gltf(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> DecodedCloud:
    """Read the meshes of a glTF 2.0 file (.glb, or .gltf with embedded data), placed by nodes."""
    check_whole_size(path, limits)
    with without_draco(path, limits) as plain:
        kind, names = check_gltf(plain, limits)
        points, triangles, kept = _load(plain, kind)
    if len(points) == 0:
        raise MalformedFileError("the mesh has no vertices")
    check_count(len(points), 0, 0, "the vertices", limits)
    triangles = check_faces(triangles, len(points))
    return DecodedCloud(
        points,
        "gltf",
        _warn_of_lost(names, kept) if attributes else (),
        attributes=kept if attributes else {},
        faces=triangles if faces and len(triangles) else None,
    )


def _warn_of_lost(names: list[str], kept: dict[str, NDArray[np.generic]]) -> tuple[str, ...]:
    """Name the attributes of the file that are not among those that are kept."""
    found = {f"_{name}" for name in kept}
    found |= {name for name, first in _KNOWN.items() if first in kept}
    lost = ", ".join(repr(name[:40]) for name in names if name not in found)
    return (f"attributes of the vertices that are not kept: {lost}"[:400],) if lost else ()


def _load(
    path: Path, kind: str
) -> tuple[NDArray[np.float64], NDArray[np.int64], dict[str, NDArray[np.generic]]]:
    """Load vertices (V, 3), triangles (T, 3) and attributes of all parts, placed in the scene."""
    trimesh = import_library("trimesh")
    vertices, faces = [np.empty((0, 3))], [np.empty((0, 3), np.int64)]
    attributes: list[dict[str, NDArray[np.generic]]] = []
    try:
        scene: Any = trimesh.load_scene(
            io.BytesIO(rewrite_parts(path.read_bytes())),
            file_type=kind,
            resolver={},  # knows no other file
            process=False,
            skip_materials=True,
        )
        for part in scene.geometry.values():
            part.vertices = dequantize(part)
        for part in scene.dump():
            if hasattr(part, "faces"):
                corners = np.asarray(part.faces, np.int64).reshape(-1, 3)
                faces.append(corners + sum(map(len, vertices)))
            vertices.append(np.asarray(part.vertices, np.float64).reshape(-1, 3))
            placement, _ = scene.graph[part.metadata["node"]]
            attributes.append(_part_attributes(part, len(vertices[-1]), placement[:3, :3]))
    except (MemoryError, CloudFileError):
        raise
    except Exception as error:  # noqa: BLE001  trimesh raises nearly anything on damaged files
        raise MalformedFileError(f"the mesh cannot be read: {short_reason(error)}") from None
    return np.concatenate(vertices), np.concatenate(faces), _join_attributes(attributes)


def _part_attributes(
    part: Any, count: int, placement: NDArray[np.float64]
) -> dict[str, NDArray[np.generic]]:
    """Return the colours, the placed normals and the attributes of one number for each vertex."""
    found: dict[str, NDArray[np.generic]] = {}
    for name, column in getattr(part, "vertex_attributes", {}).items():
        values = np.asarray(column)
        if name == NORMAL and values.shape == (count, 3):
            found |= dict(zip(_NORMALS, _place_normals(values, placement).T, strict=True))
        elif name == COLOR and values.shape in ((count, 3), (count, 4)):
            found |= dict(zip(RGB, _to_whole(values).T[:3], strict=True))
        elif values.shape in ((count,), (count, 1)) and values.dtype.kind in "biuf":
            found[str(name).removeprefix("_")] = values.reshape(-1)
    return found


def _to_whole(colors: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return fractions in 8 bits, and integers of 8 or 16 bits as they are."""
    if colors.dtype.kind != "f":
        return colors
    fractions: NDArray[np.float64] = np.nan_to_num(colors.astype(np.float64)).clip(0, 1)
    return np.rint(fractions * 255).astype(np.uint8)


def _join_attributes(
    parts: list[dict[str, NDArray[np.generic]]],
) -> dict[str, NDArray[np.generic]]:
    """Join the attributes that all parts have; colours of 8 bits become 16 beside those of 16."""
    first = parts[0] if parts else {}
    names = [name for name in first if all(name in part for part in parts)]
    joined = {}
    for name in names:
        columns = [part[name] for part in parts]
        if name in RGB and any(column.dtype.itemsize == 2 for column in columns):
            columns = [c if c.dtype.itemsize == 2 else c.astype(np.uint16) * 257 for c in columns]
        joined[name] = np.concatenate(columns)
    return joined


def _place_normals(
    normals: NDArray[np.generic], placement: NDArray[np.float64]
) -> NDArray[np.generic]:
    """Turn normals (N, 3) as `placement` moves the surface; they get length 1, or stay zero."""
    if normals.dtype.kind == "f" and np.array_equal(placement, np.eye(3)):
        return normals
    rows = placement / (np.linalg.norm(placement) or 1.0)
    cofactors = np.stack([np.cross(rows[i - 2], rows[i - 1]) for i in range(3)])
    placed = normals.astype(np.float64) @ cofactors.T * np.sign(np.linalg.det(rows))
    sizes = np.linalg.norm(placed, axis=1, keepdims=True)
    units: NDArray[np.float64] = np.divide(
        placed, sizes, out=np.zeros_like(placed), where=sizes > 0
    )
    return units
