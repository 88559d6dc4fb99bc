"""glTF as trimesh has to be told it, so that it keeps normals, and attributes of points.

It forgets the normals of a mesh that a node moves, and knows no attributes of points.
"""

from __future__ import annotations

import json
import struct
from typing import Any

from service.formats.mesh.gltf import MAGIC

NORMAL = "_ NORMAL"
"""What normals are called; trimesh keeps attributes that begin with a low line."""
_POINTS, _TRIANGLES, _INDEX = 0, 4, 5125
"""Modes of a part, and the type of its indices, uint32."""


def rewrite_parts(content: bytes) -> bytes:
    """Return a checked file with its normals renamed, and points as meshes without triangles."""
    if not content.startswith(MAGIC):
        return _rewrite(content)
    (length,) = struct.unpack_from("<I", content, 12)
    text = _rewrite(content[20 : 20 + length])
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + content[20 + length :]
    return MAGIC + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def _rewrite(text: bytes) -> bytes:
    document = json.loads(text)
    parts: list[dict[str, Any]] = [
        part for mesh in document.get("meshes", []) for part in mesh["primitives"]
    ]
    for part in parts:
        if "NORMAL" in part["attributes"]:
            part["attributes"][NORMAL] = part["attributes"].pop("NORMAL")
    points = [part for part in parts if part.get("mode", _TRIANGLES) == _POINTS]
    if points:
        none = {"componentType": _INDEX, "count": 0, "type": "SCALAR"}
        document["accessors"].append(none)
    for part in points:
        part |= {"mode": _TRIANGLES, "indices": len(document["accessors"]) - 1}
    return json.dumps(document).encode()
