"""Writer of glTF 2.0 in one binary file (.glb)."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB
from service.formats.glb import binary_chunk, pack_glb
from service.formats.writers.outgoing import Outgoing, to_float32

_FLOAT, _BYTE, _INDEX = 5126, 5121, 5125
"""Component types of glTF: float32, uint8, uint32."""
_POINTS, _TRIANGLES = 0, 4
"""Modes of a primitive."""
_UNIT_TOL = 1e-3
"""Difference of a length from 1 that is rounding; files round to four digits."""
_FORBIDDEN = re.compile(r"[^A-Za-z0-9_]")


class _Document:
    """Arrays in one buffer, and the accessors that refer to them."""

    def __init__(self) -> None:
        self.data: list[bytes] = []
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, array: NDArray[Any], component: int, kind: str, **more: Any) -> int:
        """Add an array, rows of which take a multiple of four bytes; return its accessor."""
        content = array.tobytes()
        offset = sum(map(len, self.data))
        self.views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(content)})
        self.data.append(content)
        accessor = {"bufferView": len(self.views) - 1, "componentType": component, "type": kind}
        self.accessors.append({**accessor, "count": len(array), **more})
        return len(self.accessors) - 1


def write(path: Path, cloud: Outgoing) -> None:
    """Write one mesh of triangles, or of points; a node moves it, so that float32 suffices."""
    cloud.drop_non_finite()
    cloud.use_8_bit_colors()
    cloud.rename(_FORBIDDEN)
    document = _Document()
    points = cloud.points.astype(np.float64)
    center = (points.min(axis=0) + points.max(axis=0)) / 2 if len(points) else np.zeros(3)
    center = np.round(center)
    attributes = {"POSITION": _add_positions(document, points - center)}
    if (normals := _unit_normals(cloud)) is not None:
        attributes["NORMAL"] = document.add(normals, _FLOAT, "VEC3")
    if all(name in cloud.columns for name in RGB):
        opaque = np.full((len(points), 1), 255, np.uint8)
        colors = np.hstack([cloud.take(RGB), opaque]).astype(np.uint8)
        attributes["COLOR_0"] = document.add(colors, _BYTE, "VEC4", normalized=True)
    for name, column in cloud.columns.items():
        attributes[f"_{name}"] = document.add(_to_float32(cloud, name, column), _FLOAT, "SCALAR")
    primitive: dict[str, Any] = {"attributes": attributes, "mode": _POINTS}
    if cloud.faces is not None and len(cloud.faces):
        indices = document.add(cloud.faces.astype("<u4").ravel(), _INDEX, "SCALAR")
        primitive |= {"indices": indices, "mode": _TRIANGLES}
    path.write_bytes(_render(document, primitive, center.tolist()))


def _add_positions(document: _Document, points: NDArray[np.float64]) -> int:
    positions = to_float32(points)
    bounds = (
        {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
        if len(positions)
        else {}
    )
    return document.add(positions, _FLOAT, "VEC3", **bounds)


def _unit_normals(cloud: Outgoing) -> NDArray[Any] | None:
    """Take the normals and scale them to length 1, which glTF demands; none stay zero."""
    normals = cloud.take_normals()
    if normals is None:
        return None
    normals = np.nan_to_num(normals.astype(np.float64))
    sizes = np.linalg.norm(normals, axis=1, keepdims=True)
    if not np.allclose(sizes[sizes > 0], 1, rtol=0, atol=_UNIT_TOL):
        cloud.notes.append("the normals are scaled to length 1, as glTF demands")
    units: NDArray[Any] = np.divide(normals, sizes, out=np.zeros_like(normals), where=sizes > 0)
    return units.astype("<f4")


def _to_float32(cloud: Outgoing, name: str, column: NDArray[Any]) -> NDArray[Any]:
    rounded = to_float32(column)
    if not np.array_equal(rounded, column, equal_nan=column.dtype.kind == "f"):
        cloud.notes.append(f"{name[:40]!r} is rounded to float32")
    return rounded


def _render(document: _Document, primitive: dict[str, Any], center: list[float]) -> bytes:
    data = b"".join(document.data)
    content = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": center}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": document.accessors,
        "bufferViews": document.views,
        "buffers": [{"byteLength": len(data)}],
    }
    return pack_glb(json.dumps(content).encode(), binary_chunk(data))
