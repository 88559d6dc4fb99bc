"""glTF with meshes compressed by Draco (KHR_draco_mesh_compression), written without."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import ReadLimits
from service.formats.draco import decode_draco
from service.formats.errors import CloudFileError, FileLimitError, MalformedFileError
from service.formats.glb import MAGIC, split_glb

_EXTENSION = "KHR_draco_mesh_compression"
_MAX_JSON_BYTES = 64 << 20
_MAX_PRIMITIVES = 10_000
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""NumPy's types by the component types of glTF."""
_UNSIGNED_INT = 5125


@contextmanager
def without_draco(path: Path, limits: ReadLimits) -> Iterator[Path]:
    """Provide the file, or a copy whose meshes are not compressed.

    Raises
    ------
    CloudFileError
        A compressed mesh is damaged.
    """
    content = path.read_bytes()
    text, blob = _split(content)
    if f'"{_EXTENSION}"'.encode() not in text:
        yield path
        return
    if len(text) > _MAX_JSON_BYTES:
        raise FileLimitError(f"{len(text)} bytes of JSON; the limit is {_MAX_JSON_BYTES}")
    try:
        document = json.loads(text)
        _expand(document, blob, limits)
    except CloudFileError:
        raise
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError) as error:
        raise MalformedFileError(
            f"the extension {_EXTENSION} is not valid: {error!r}"[:300]
        ) from None
    with TemporaryDirectory(prefix="gltf-") as folder:
        plain = Path(folder) / "plain.gltf"
        plain.write_text(json.dumps(document))
        yield plain


def _split(content: bytes) -> tuple[bytes, bytes]:
    """Return the JSON and the binary chunk."""
    if not content.startswith(MAGIC) or len(content) < 20:
        return content, b""
    text, chunks = split_glb(content)
    return text, chunks[8:]


def _expand(document: dict[str, Any], blob: bytes, limits: ReadLimits) -> None:
    """Replace the compressed meshes of the document; all its data are embedded then."""
    buffers = [_buffer(item, blob) for item in document.get("buffers", [])]
    for item, data in zip(document.get("buffers", []), buffers, strict=True):
        item |= {"uri": _to_uri(data), "byteLength": len(data)}
    primitives = [
        part for mesh in document.get("meshes", []) for part in mesh.get("primitives", [])
    ]
    if len(primitives) > _MAX_PRIMITIVES:
        raise FileLimitError(f"{len(primitives)} parts; the limit is {_MAX_PRIMITIVES}")
    for primitive in primitives:
        extension = primitive.get("extensions", {}).pop(_EXTENSION, None)
        if extension is not None:
            _expand_primitive(document, buffers, primitive, extension, limits)
    for key in ("extensionsUsed", "extensionsRequired"):
        document[key] = [name for name in document.get(key, []) if name != _EXTENSION]


def _expand_primitive(
    document: dict[str, Any],
    buffers: list[bytes],
    primitive: dict[str, Any],
    extension: dict[str, Any],
    limits: ReadLimits,
) -> None:
    view = document["bufferViews"][extension["bufferView"]]
    start = view.get("byteOffset", 0)
    data = buffers[view["buffer"]][start : start + view["byteLength"]]
    mesh = decode_draco(data, limits)
    for name, number in extension["attributes"].items():
        accessor = document["accessors"][primitive["attributes"][name]]
        values = np.asarray(mesh.get_attribute_by_unique_id(number)["data"])
        _store(document, accessor, values.astype(_TYPES[accessor["componentType"]]))
    if "indices" in primitive:
        accessor = document["accessors"][primitive["indices"]]
        accessor["componentType"] = _UNSIGNED_INT
        _store(document, accessor, np.asarray(mesh.faces, "<u4").reshape(-1))


def _store(document: dict[str, Any], accessor: dict[str, Any], values: NDArray[Any]) -> None:
    """Put the numbers of an accessor into a buffer of their own."""
    data = values.tobytes()
    document["buffers"].append({"uri": _to_uri(data), "byteLength": len(data)})
    view = {"buffer": len(document["buffers"]) - 1, "byteOffset": 0, "byteLength": len(data)}
    document["bufferViews"].append(view)
    accessor |= {
        "bufferView": len(document["bufferViews"]) - 1,
        "byteOffset": 0,
        "count": len(values),
    }


def _buffer(item: dict[str, Any], blob: bytes) -> bytes:
    """Return the bytes of a buffer that is embedded."""
    if "uri" not in item:
        return blob
    head, _, data = item["uri"].partition(";base64,")
    if not head.startswith("data:"):
        raise MalformedFileError(
            "the file refers to data in other files; send a .glb with all data embedded"
        )
    return base64.b64decode(data)


def _to_uri(data: bytes) -> str:
    return f"data:application/octet-stream;base64,{base64.b64encode(data).decode()}"
