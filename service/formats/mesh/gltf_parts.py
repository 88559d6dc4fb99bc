"""glTF as trimesh has to be told it, so that it keeps normals, and attributes of points.

It forgets the normals of a mesh that a node moves, knows no attributes of points, cuts colours of
16 bits at 255, and takes positions as they are stored, which are fractions of the largest integer
where they are normalized.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.errors import UnsupportedFileError
from service.formats.glb import MAGIC, pack_glb, split_glb

NORMAL, COLOR = "_ NORMAL", "_ COLOR_0"
"""What normals and colours are called; trimesh keeps attributes that begin with a low line."""
_ONE = "largest integer"
"""What the integer that stands for 1 is called in what trimesh keeps of a mesh."""
_LARGEST = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535}
"""Largest integers by the component types of glTF."""
_TRIANGLES, _STRIP, _FAN, _INDEX = 4, 5, 6, 5125
"""Modes of a part with faces, and the type of its indices, uint32."""


def rewrite_parts(content: bytes) -> bytes:
    """Return a checked file as trimesh keeps all of it.

    Raises
    ------
    UnsupportedFileError
        A part is stored in a way that is not read.
    """
    if not content.startswith(MAGIC):
        return _rewrite(content)
    text, chunks = split_glb(content)
    return pack_glb(_rewrite(text), chunks)


def _rewrite(text: bytes) -> bytes:
    document = json.loads(text)
    parts: list[dict[str, Any]] = [
        part for mesh in document.get("meshes", []) for part in mesh["primitives"]
    ]
    for part in parts:
        for name, kept in (("NORMAL", NORMAL), ("COLOR_0", COLOR)):
            if name in part["attributes"]:
                part["attributes"][kept] = part["attributes"].pop(name)
    if any(part.get("mode") == _FAN for part in parts):
        raise UnsupportedFileError(
            "a part is a fan of triangles (mode 6), which is not read: write single triangles"
        )
    # trimesh leaves out loops and strips of lines, and what points have
    points = [part for part in parts if part.get("mode", _TRIANGLES) not in (_TRIANGLES, _STRIP)]
    if points:
        none = {"componentType": _INDEX, "count": 0, "type": "SCALAR"}
        document["accessors"].append(none)
    for part in points:
        part |= {"mode": _TRIANGLES, "indices": len(document["accessors"]) - 1}
    for mesh in document.get("meshes", []):
        mesh["extras"] = {_ONE: _largest_integer(mesh, document["accessors"])}
    return json.dumps(document).encode()


def _largest_integer(mesh: dict[str, Any], accessors: list[dict[str, Any]]) -> int:
    """Return the integer that stands for 1 in the positions; 1 if they are stored as they are.

    Raises
    ------
    UnsupportedFileError
        It is not the same in all parts of the mesh.
    """
    found = {1}
    for number, part in enumerate(mesh["primitives"]):
        accessor = accessors[part["attributes"]["POSITION"]]
        one = _LARGEST.get(accessor["componentType"], 1) if accessor.get("normalized") else 1
        found = found | {one} if number else {one}
    if len(found) > 1:
        raise UnsupportedFileError(
            "a mesh has parts whose positions are quantized in unlike ways, which is not read"
        )
    return found.pop()


def dequantize(part: Any) -> NDArray[np.float64]:
    """Return the positions (N, 3) of a mesh as trimesh has loaded it, of the rewritten file."""
    stored = np.asarray(part.vertices, np.float64)
    one = part.metadata.get(_ONE, 1)
    return stored if one == 1 else np.maximum(stored / one, -1.0)
