"""Meshes by trimesh: STL, OBJ, OFF, glTF; their vertices, or samples of their surface."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, Limits, check_count
from service.formats.errors import FileLimitError, MalformedFileError, TruncatedFileError
from service.formats.mesh import text as mesh_text
from service.formats.mesh.gltf import check_gltf

SEED = 0  # of the surface samples: the same file gives the same points
_STL_HEAD, _STL_ROW = 84, 50
_SNIFFED_TRIANGLES = 20
_LARGEST = 1e12  # of a coordinate; a quarter of random floats are in the range, rows are 12


def sniff_stl(head: bytes) -> bool:
    """Whether it is an ASCII solid, or the first triangles of a binary one make sense."""
    if head.lstrip().startswith(b"solid") and b"facet" in head and b"\0" not in head:
        return True
    body = head[_STL_HEAD:]
    rows = min(len(body) // _STL_ROW, _SNIFFED_TRIANGLES)
    if rows == 0 or struct.unpack_from("<I", head, 80)[0] < rows:
        return False
    layout = np.dtype([("floats", "<f4", 12), ("attribute", "<u2")])
    floats = np.frombuffer(body, layout, rows)["floats"]
    with np.errstate(invalid="ignore"):
        sizes = np.abs(floats)
        plausible = (sizes < _LARGEST) & ((sizes > 1 / _LARGEST) | (sizes == 0))
    return bool(plausible.all() and (floats[:, 3:] != 0).any())


def read_stl(path: Path, limits: Limits, surface_samples: int | None) -> DecodedCloud:
    """Read an STL file; its corners are merged where they agree exactly."""
    _check_stl(path, limits)
    return _read(path, limits, "stl", surface_samples)


def read_obj(path: Path, limits: Limits, surface_samples: int | None) -> DecodedCloud:
    """Read an OBJ file: the vertices in the order of the file, or surface samples."""
    vertices = mesh_text.read_obj(path, limits)
    return vertices if surface_samples is None else _read(path, limits, "obj", surface_samples)


def read_off(path: Path, limits: Limits, surface_samples: int | None) -> DecodedCloud:
    """Read an OFF file: the vertices in the order of the file, or surface samples."""
    vertices = mesh_text.read_off(path, limits)
    return vertices if surface_samples is None else _read(path, limits, "off", surface_samples)


def read_gltf(path: Path, limits: Limits, surface_samples: int | None) -> DecodedCloud:
    """Read the meshes of a glTF 2.0 file (.glb, or .gltf with its data inside), each in place."""
    kind = check_gltf(path, limits)
    return _read(path, limits, kind, surface_samples)


def _read(path: Path, limits: Limits, kind: str, surface_samples: int | None) -> DecodedCloud:
    name = "gltf" if kind == "glb" else kind
    vertices, faces = _load(path, kind)
    if len(vertices) == 0:
        raise MalformedFileError("the mesh has no vertices")
    check_count(len(vertices), 0, 0, "the vertices", limits)
    if surface_samples is None:
        points = _distinct(vertices) if kind == "stl" else vertices
        return DecodedCloud(points, name, ("the vertices are used, not the surface",))
    if surface_samples > limits.max_points:
        raise FileLimitError(f"{surface_samples} samples; at most {limits.max_points} points")
    points, normals = _sampled(vertices, faces, surface_samples)
    return DecodedCloud(points, name, (), normals)


def _load(path: Path, kind: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """All vertices (V, 3) and triangles (T, 3) of the file, every part in its place."""
    import trimesh

    vertices, faces = [np.empty((0, 3))], [np.empty((0, 3), np.int64)]
    try:
        with path.open("rb") as file:
            scene: Any = trimesh.load_scene(
                file, file_type=kind, process=False, skip_materials=True
            )
        for part in scene.dump():
            if hasattr(part, "faces"):
                corners = np.asarray(part.faces, np.int64).reshape(-1, 3)
                faces.append(corners + sum(map(len, vertices)))
            vertices.append(np.asarray(part.vertices, np.float64).reshape(-1, 3))
    except MemoryError:
        raise
    except Exception as error:  # noqa: BLE001  trimesh raises nearly anything on damaged files
        reason = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        raise MalformedFileError(f"the mesh cannot be read: {reason}") from None
    return np.concatenate(vertices), np.concatenate(faces)


def _distinct(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Each place once, in the order of the first appearance."""
    _, first = np.unique(vertices, axis=0, return_index=True)
    return vertices[np.sort(first)]


def _sampled(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points spread evenly by area, and the normals of their triangles."""
    import trimesh

    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise MalformedFileError("a triangle names a vertex that is not there")
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    if not (np.isfinite(mesh.area) and mesh.area > 0):
        raise MalformedFileError(f"{len(faces)} triangles of area {mesh.area}: nothing to sample")
    points, triangles = trimesh.sample.sample_surface(mesh, count, seed=SEED)
    return np.asarray(points, np.float64), np.asarray(mesh.face_normals[triangles], np.float64)


def _check_stl(path: Path, limits: Limits) -> None:
    """A binary file holds the triangles that it announces, an ASCII file has its end."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(1024)
        file.seek(max(0, size - 1024))
        tail = file.read()
    if head.lstrip().startswith(b"solid") and b"facet" in head:
        if b"endsolid" not in tail:
            raise TruncatedFileError(f"byte {size}: the file ends before 'endsolid'")
        return
    count = struct.unpack_from("<I", head, 80)[0] if len(head) >= _STL_HEAD else 0
    check_count(3 * count, 0, 0, "byte 80", limits)
    if _STL_HEAD + _STL_ROW * count > size:
        raise TruncatedFileError(f"byte 80: {count} triangles do not fit into {size} bytes")
