"""Small files of the formats that libraries read: LAS, LAZ, E57, meshes, PTX, and wrapped ones."""

from __future__ import annotations

import base64
import gzip
import io
import json
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import laspy
import numpy as np
import pye57
from numpy.typing import NDArray

from tests.factories.cloud_files import NORMALS, POINTS, ply, text_rows
from tests.factories.gltf import glb_file
from tests.factories.vtk_files import legacy_mesh, xml_mesh

Array = NDArray[np.float64]
DOUBLES = POINTS.astype(np.float64)
FACES = np.array([(i, i + 1, i + 2) for i in range(38)])
QUARTER_TURN = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
MOVE = np.array([10.0, 20, 30])
STEP = np.array([1.0, 2, -3])
"""From where one scan of a file was measured to where the next one was."""


@cache
def las(*, compressed: bool = False, version: str = "1.2") -> bytes:
    kind = 6 if version == "1.4" else 3
    header = laspy.LasHeader(point_format=kind, version=version)
    header.scales, header.offsets = np.full(3, 0.001), np.array([500_000.0, 4_000_000, 0])
    data = laspy.LasData(header)
    data.x, data.y, data.z = (DOUBLES + header.offsets).T
    data.intensity = np.arange(40)
    file = io.BytesIO()
    data.write(file, do_compress=compressed, laz_backend=laspy.LazBackend.Lazrs)
    return file.getvalue()


@cache
def e57(scans: int = 1, step: tuple[float, ...] = tuple(STEP)) -> bytes:
    """Each scan is some of the points as they were before a quarter turn and a move of its own."""
    return e57_of(np.array_split(DOUBLES, scans), MOVE + np.arange(scans)[:, None] * step)


def e57_of(scans: Sequence[Array], places: Array) -> bytes:
    """Scans (N, 3) of one frame, each written as measured from its place, after a quarter turn."""
    half_angle = np.sqrt(0.5)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.e57"
        file = pye57.E57(str(path), mode="w")
        for points, place in zip(scans, places, strict=True):
            local = (points - place) @ QUARTER_TURN
            columns = dict(
                zip(("cartesianX", "cartesianY", "cartesianZ"), local.T.copy(), strict=True)
            )
            file.write_scan_raw(
                columns,
                rotation=np.array([half_angle, 0, 0, half_angle]),
                translation=place,
            )
        file.close()
        return path.read_bytes()


PAGE, HELD = 1024, 1020
"""Bytes of a page of an E57 file, and those before its checksum."""
_CRC_32C = [0] * 256
for _byte in range(256):
    _rest = _byte
    for _ in range(8):
        _rest = _rest >> 1 ^ (0x82F63B78 if _rest & 1 else 0)
    _CRC_32C[_byte] = _rest


def whole_e57(content: bytes) -> bytes:
    """The content in whole pages, its length and the checksum of each page put right."""
    padded = content + bytes(-len(content) % PAGE)
    padded = padded[:16] + struct.pack("<Q", len(padded)) + padded[24:]
    pages = (padded[at : at + HELD] for at in range(0, len(padded), PAGE))
    return b"".join(page + _checksum(page) for page in pages)


def _checksum(page: bytes) -> bytes:
    rest = 0xFFFFFFFF
    for byte in page:
        rest = rest >> 8 ^ _CRC_32C[(rest ^ byte) & 0xFF]
    return struct.pack(">I", rest ^ 0xFFFFFFFF)


def stl_binary() -> bytes:
    """13 triangles: the first 39 points, three by three."""
    rows = [struct.pack("<3f9fH", 0, 0, 1, *corners, 0) for corners in POINTS[:39].reshape(13, 9)]
    return b"made by hand".ljust(80) + struct.pack("<I", len(rows)) + b"".join(rows)


def stl_ascii() -> bytes:
    lines = ["solid made by hand"]
    for corners in POINTS[:39].reshape(13, 3, 3):
        lines += ["facet normal 0 0 1", "outer loop"]
        lines += [f"vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid\n"]).encode()


def obj() -> bytes:
    lines = ["# by hand", "mtllib ../../../etc/passwd", "vn 0 0 1"]
    lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in POINTS]
    lines += [f"f {a + 1}//1 {b + 1}//1 {c + 1}//1" for a, b, c in FACES]
    return "\n".join([*lines, ""]).encode()


def off() -> bytes:
    faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES)
    return b"OFF\n# by hand\n40 38 0\n" + text_rows(POINTS) + faces.encode()


def colored_off() -> bytes:
    """Vertices with a normal and a colour of four numbers."""
    rows = text_rows(POINTS).decode().splitlines()
    lines = [f"{row} 0 0.6 0.8 255 {i} 7 255" for i, row in enumerate(rows)]
    return "\n".join(["CNOFF", "40 1 0", *lines, "3 0 1 2", ""]).encode()


def _gltf() -> tuple[dict[str, object], bytes]:
    """A document and its data: a node moves the mesh, whose vertices are moved back."""
    data = (POINTS - MOVE.astype(np.float32)).tobytes() + FACES.astype("<u4").tobytes()
    data += NORMALS.astype("<f4").tobytes()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": MOVE.tolist()}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 2}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 40, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 114, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 40, "type": "VEC3"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 480},
            {"buffer": 0, "byteOffset": 480, "byteLength": 456},
            {"buffer": 0, "byteOffset": 936, "byteLength": 480},
        ],
        "buffers": [{"byteLength": len(data)}],
    }
    return document, data


def gltf() -> bytes:
    document, data = _gltf()
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    return json.dumps(document | {"buffers": [{"byteLength": len(data), "uri": uri}]}).encode()


def glb(**changes: object) -> bytes:
    document, data = _gltf()
    return glb_file(document | changes, data)


def ptx(scans: int = 1, step: tuple[float, ...] = tuple(STEP)) -> bytes:
    """Each scan before a quarter turn and a move of its own."""
    return ptx_of(np.array_split(DOUBLES, scans), MOVE + np.arange(scans)[:, None] * step)


def ptx_of(scans: Sequence[Array], places: Array) -> bytes:
    """Scans as `e57_of` writes them, as row vectors times the matrix; a multiple of 4 points."""
    content = b""
    matrix = np.eye(4)
    for points, place in zip(scans, places, strict=True):
        matrix[:3, :3], matrix[3, :3] = QUARTER_TURN.T, place
        local = (points - place) @ QUARTER_TURN
        content += f"{len(points) // 4}\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n".encode()
        content += text_rows(matrix)
        content += text_rows(np.column_stack([local, np.full(len(points), 0.5)]))
    return content


def pts() -> bytes:
    rows = np.column_stack([POINTS, np.full(40, -900), np.full((40, 3), 128)])
    return b"40\n" + text_rows(rows)


def kitti() -> bytes:
    return np.column_stack([POINTS, np.ones(40)]).astype("<f4").tobytes()


def rows_of(columns: int) -> bytes:
    """Float32 rows without a header: the points, intensity, and numbers of rings."""
    others = [np.full(40, 0.5), *(np.full(40, float(number)) for number in range(4))]
    return np.column_stack([POINTS, *others][: columns - 2]).astype("<f4").tobytes()


def colmap() -> bytes:
    """COLMAP's points3D.bin, with tracks of different lengths."""
    content = struct.pack("<Q", 40)
    for number, (x, y, z) in enumerate(DOUBLES.tolist()):
        length = 2 + number % 3
        content += struct.pack("<Q3d3BdQ", number + 7, x, y, z, 9, 8, 7, 0.5, length)
        content += struct.pack(f"<{2 * length}i", *range(2 * length))
    return content


def splat() -> bytes:
    rows = zip(POINTS.tolist(), range(40), strict=True)
    return b"".join(
        struct.pack("<6f8B", *point, 0.1, 0.2, 0.3, i, 2, 3, 255, 255, 128, 128, 128)
        for point, i in rows
    )


def spz() -> bytes:
    """Niantic's splats, not yet in gzip; positions have 12 bits behind the point."""
    counts = np.rint(DOUBLES * 4096).astype("<i4").view(np.uint8).reshape(-1, 4)[:, :3]
    rest = bytes(40) + bytes(120) + bytes(120) + bytes(160)
    return b"NGSP" + struct.pack("<II4B", 3, 40, 0, 12, 0, 0) + counts.tobytes() + rest


def lvx2() -> bytes:
    """Two frames of two packages; the device stands behind a quarter turn and a move."""
    head = b"livox_tech".ljust(16, b"\0") + struct.pack("<4BIIB", 2, 0, 0, 0, 0xAC0EA767, 50, 1)
    content = head + struct.pack("<32sI2BB6f", b"", 7, 0, 9, 1, 0, 0, 90, *MOVE.tolist())
    local = np.rint((DOUBLES - MOVE) @ QUARTER_TURN * 1000).astype("<i4")
    for frame in range(2):
        packages = b""
        for part in np.split(local[20 * frame : 20 * frame + 20], 2):
            packages += struct.pack("<BIBBQHBIB4x", 0, 7, 0, 0, 10**9, 0, 1, 14 * len(part), 0)
            packages += b"".join(row.tobytes() + b"\x32\0" for row in part)
        start = len(content)
        content += struct.pack("<3Q", start, start + 24 + len(packages), frame) + packages
    return content


def vtk(*, binary: bool = False) -> bytes:
    """A legacy VTK file; in ASCII with three points a line."""
    form = b"BINARY" if binary else b"ASCII"
    head = b"# vtk DataFile Version 3.0\nby hand\n" + form + b"\nDATASET POLYDATA\n"
    lines = text_rows(POINTS[:39].reshape(-1, 9)) + text_rows(POINTS[39:])
    points = POINTS.astype(">f4").tobytes() + b"\n" if binary else lines
    return head + b"POINTS 40 float\n" + points + b"VERTICES 1 2\n1 0\n"


def vtp(form: str = "ascii", *, compressed: bool = False) -> bytes:
    """VTK in XML: "ascii", "binary" (base64), "appended" (base64) or "raw"."""
    data = POINTS.astype("<f4").tobytes()
    packed = zlib.compress(data)
    header = struct.pack("<4I", 1, len(data), 0, len(packed)) if compressed else b""
    whole = [header, packed] if compressed else [struct.pack("<I", len(data)) + data]
    text = b"".join(whole if form == "raw" else map(base64.b64encode, whole))
    compressor = ' compressor="vtkZLibDataCompressor"' if compressed else ""
    place = 'appended" offset="0' if form in ("appended", "raw") else form
    inline = {"ascii": text_rows(POINTS), "binary": text}.get(form, b"")
    encoding = "raw" if form == "raw" else "base64"
    appended = f'<AppendedData encoding="{encoding}">\n_'.encode() + text + b"\n</AppendedData>"
    return (
        f'<?xml version="1.0"?>\n<VTKFile type="PolyData" byte_order="LittleEndian"{compressor}>'
        f"<PolyData><Piece><PointData/><Points><DataArray type="
        f'"Float32" NumberOfComponents="3" format="{place}">'
    ).encode() + (
        inline
        + b"</DataArray></Points></Piece></PolyData>"
        + (appended if form in ("appended", "raw") else b"")
        + b"</VTKFile>\n"
    )


def zipped(content: bytes, name: str = "scans/../../../étage 2.ply") -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return file.getvalue()


def scanner_seeds() -> dict[str, bytes]:
    """One valid file of every kind."""
    return {
        "las": las(),
        "las 1.4": las(version="1.4"),
        "laz": las(compressed=True),
        "e57": e57(),
        "stl binary": stl_binary(),
        "stl ascii": stl_ascii(),
        "obj": obj(),
        "off": off(),
        "off colours": colored_off(),
        "gltf": gltf(),
        "glb": glb(),
        "ptx": ptx(),
        "pts": pts(),
        "colmap": colmap(),
        "splat": splat(),
        "spz": spz(),
        "lvx2": lvx2(),
        "vtk": vtk(),
        "vtk binary": vtk(binary=True),
        "vtk mesh": legacy_mesh(binary=False, new=False),
        "vtk binary mesh": legacy_mesh(binary=True, new=True),
        "vtp": vtp(),
        "vtp mesh": xml_mesh(),
        "vtp raw": vtp("raw", compressed=True),
        "gzip": gzip.compress(ply(), mtime=0),
        "zip": zipped(ply()),
    }
