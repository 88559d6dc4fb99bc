"""Checks of a glTF file before trimesh allocates memory for it."""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path
from typing import Any

from service.formats.decoded_cloud import ReadLimits, check_count
from service.formats.errors import (
    FileLimitError,
    MalformedFileError,
    TruncatedFileError,
    UnsupportedFileError,
)
from service.formats.faces import check_face_count
from service.formats.glb import MAGIC

_TOP_LEVEL_KEYS = (b"asset", b"accessors", b"buffers", b"bufferViews", b"meshes")
_MAX_JSON_BYTES = 64 << 20
_EMBEDDED = re.compile(r"data:[A-Za-z0-9.+/-]{0,100};base64,")
_MESHOPT = "_meshopt_compression"
"""End of the names of the extension, EXT or KHR."""
_MAX_NODES = 100_000
_MAX_DEPTH = 100
"""Levels of nodes; the time that trimesh takes grows with the square of the depth."""


def sniff(head: bytes) -> bool:
    """Whether it is a .glb, or JSON with a key of the glTF schema."""
    if head.startswith(MAGIC):
        return True
    return head.lstrip()[:1] == b"{" and any(b'"%s"' % key in head for key in _TOP_LEVEL_KEYS)


def check_gltf(path: Path, limits: ReadLimits) -> tuple[str, list[str]]:
    """Check the announced sizes; return "glb" or "gltf", and the attributes of the vertices.

    Raises
    ------
    CloudFileError
        The file is truncated, refers to other files, or announces more than it holds.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(20)
        binary = head.startswith(MAGIC)
        if binary:
            length = _check_binary_header(head, size)
        else:
            file.seek(0)
            length = size
        if length > _MAX_JSON_BYTES:
            raise FileLimitError(f"{length} bytes of JSON; the limit is {_MAX_JSON_BYTES}")
        text = file.read(length)
    try:
        document = json.loads(text)
        _check_document(document, size, limits)
        names = _attribute_names(document)
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError) as error:
        if isinstance(error, (MalformedFileError, FileLimitError, UnsupportedFileError)):
            raise
        raise MalformedFileError(
            f"the JSON of the glTF file is not valid: {error!r}"[:300]
        ) from None
    return "glb" if binary else "gltf", names


def _attribute_names(document: dict[str, Any]) -> list[str]:
    parts = [part for mesh in document.get("meshes", []) for part in mesh["primitives"]]
    return sorted({name for part in parts for name in part["attributes"]} - {"POSITION"})


def _check_binary_header(head: bytes, size: int) -> int:
    if len(head) < 20:
        raise TruncatedFileError(f"byte {len(head)}: the file ends within the glTF header")
    version, total, length, kind = struct.unpack_from("<III4s", head, 4)
    if version != 2 or kind != b"JSON":
        raise UnsupportedFileError(
            f"byte 4: glTF version {version}, first chunk {kind!r}; expected version 2, JSON"
        )
    if total != size or length > size - 20:
        raise TruncatedFileError(f"byte 8: the header announces {total} bytes, the file has {size}")
    return int(length)


def _check_document(document: dict[str, Any], size: int, limits: ReadLimits) -> None:
    if any(str(name).endswith(_MESHOPT) for name in document.get("extensionsRequired", [])):
        raise UnsupportedFileError(
            "the meshes are compressed by meshopt, which is not read: write the glTF without "
            "compression, or with that of Draco"
        )
    for item in document.get("buffers", []):
        if not _EMBEDDED.match(str(item.get("uri", "data:;base64,"))):
            raise UnsupportedFileError(
                "the file refers to data in other files; send a .glb with all data embedded"
            )
    for number, accessor in enumerate(document.get("accessors", [])):
        if "bufferView" not in accessor or "sparse" in accessor:
            raise UnsupportedFileError(
                f"accessor {number} is sparse or compressed, which is not read"
            )
        count = accessor["count"]
        if not isinstance(count, int) or count < 0 or count > size:
            raise TruncatedFileError(
                f"accessor {number} announces {count!r} elements in a file of {size} bytes"
            )
    nodes = document.get("nodes", [])
    children = [child for node in nodes for child in node.get("children", [])]
    if len(nodes) > _MAX_NODES or len(set(children)) != len(children):
        raise MalformedFileError(
            f"{len(nodes)} nodes: too many (the limit is {_MAX_NODES}), or one has two parents"
        )
    _check_depth(nodes, set(children))
    vertices, corners = _count_placed(document, nodes)
    check_count(vertices, 0, 0, "the nodes", limits)
    check_face_count(vertices, corners // 3, limits)


def _check_depth(nodes: list[dict[str, Any]], children: set[int]) -> None:
    """Check the depth of the tree: trimesh multiplies all matrices above each node."""
    known = range(len(nodes))
    level = [number for number in known if number not in children]
    for _ in range(_MAX_DEPTH):
        level = [child for number in level for child in nodes[number].get("children", [])]
        if not all(child in known for child in level):
            raise MalformedFileError("a node has a child that does not exist")
        if not level:
            return
    raise FileLimitError(f"the nodes are nested deeper than {_MAX_DEPTH} levels")


def _count_placed(document: dict[str, Any], nodes: list[dict[str, Any]]) -> tuple[int, int]:
    """Count the vertices and corners of all meshes, each as often as nodes place it."""
    accessors = document.get("accessors", [])
    meshes = document.get("meshes", [])
    vertices, corners = (
        [sum(accessors[part]["count"] for part in _parts(mesh, kind)) for mesh in meshes]
        for kind in ("POSITION", "indices")
    )
    placed = [node["mesh"] for node in nodes if "mesh" in node]
    return sum(vertices[mesh] for mesh in placed), sum(corners[mesh] for mesh in placed)


def _parts(mesh: dict[str, Any], kind: str) -> list[int]:
    """Return the accessors of the positions, or of the indices, of the parts of a mesh."""
    if kind == "POSITION":
        return [part["attributes"]["POSITION"] for part in mesh["primitives"]]
    return [part["indices"] for part in mesh["primitives"] if "indices" in part]
