"""Binary glTF files, built by hand."""

from __future__ import annotations

import json
import struct
from typing import Any


def glb_file(document: dict[str, Any], data: bytes) -> bytes:
    """Return the file of a document and of its only buffer."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def scene_of(node: dict[str, Any]) -> dict[str, Any]:
    """Return the beginning of a document whose scene is one node."""
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **node}],
    }
