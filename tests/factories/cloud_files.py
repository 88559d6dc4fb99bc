"""Small cloud files of every kind, written by hand so that no reader checks its own writer."""

from __future__ import annotations

import io
import struct

import numpy as np
from numpy.typing import NDArray

POINTS: NDArray[np.float32] = (
    np.random.default_rng(5).uniform(-100, 100, (40, 3)).round(3).astype(np.float32)
)
NORMALS: NDArray[np.float32] = np.random.default_rng(6).normal(size=(40, 3)).astype(np.float32)


def text_rows(points: NDArray[np.floating], delimiter: str = " ", end: str = "\n") -> bytes:
    return "".join(delimiter.join(f"{value:.9g}" for value in row) + end for row in points).encode()


def ply(form: str = "binary_little_endian", lists: str = "none") -> bytes:
    """A PLY file with normals and a colour; lists "before" or "inside" the vertices, or "after"."""
    order = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}[form]
    faces = [[0, 1, 2], [1, 2, 3, 4], [], [5, 6, 7]]
    face_header = (
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nproperty short flag\n"
    )
    header = f"ply\nformat {form} 1.0\ncomment café\nobj_info made by hand\n"
    header += face_header if lists == "before" else ""
    header += "element vertex 40\nproperty float x\n"
    header += "property list uchar float weights\n" if lists == "inside" else ""
    header += "property float y\nproperty uchar red\nproperty float z\n"
    header += "".join(f"property float {name}\n" for name in ("nx", "ny", "nz"))
    header += face_header if lists == "after" else ""
    body, face_body = b"", b""
    for i, face in enumerate(faces):
        values = [len(face), *face, i]
        face_body += (
            struct.pack(f"{order}B{len(face)}ih", *values)
            if order
            else (" ".join(map(str, values)) + "\n").encode()
        )
    for i, (point, normal) in enumerate(zip(POINTS, NORMALS, strict=True)):
        weights = [0.5] * (i % 3) if lists == "inside" else []
        if order:
            body += struct.pack(f"{order}f", point[0])
            body += struct.pack(f"{order}B{len(weights)}f", len(weights), *weights) * (
                lists == "inside"
            )
            body += struct.pack(f"{order}fBf3f", point[1], i, point[2], *normal)
        else:
            values = [point[0], point[1], i, point[2], *normal]
            body += (" ".join(f"{value:.9g}" for value in values) + "\n").encode()
    parts = [face_body if lists == "before" else b"", body, face_body if lists == "after" else b""]
    return header.encode("latin1") + b"end_header\n" + b"".join(parts)


def lzf_literals(content: bytes) -> bytes:
    """LZF data without back references: runs of up to 32 literal bytes."""
    runs = [content[i : i + 32] for i in range(0, len(content), 32)]
    return b"".join(bytes([len(run) - 1]) + run for run in runs)


def pcd(data: str = "binary") -> bytes:
    """A PCD file with padding, normals before the coordinates and a field of three numbers."""
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        "FIELDS normal_x normal_y normal_z _ x y z histogram\nSIZE 4 4 4 1 4 4 4 2\n"
        "TYPE F F F U F F F U\nCOUNT 1 1 1 4 1 1 1 3\nWIDTH 20\nHEIGHT 2\n"
        f"VIEWPOINT 1 2 3 1 0 0 0\nPOINTS 40\nDATA {data}\n"
    ).encode()
    if data == "ascii":
        rows = np.hstack([NORMALS, np.zeros((40, 4)), POINTS, np.ones((40, 3))])
        return header + text_rows(rows)
    if data == "binary":
        return header + b"".join(
            struct.pack("<3f4x3f3H", *normal, *point, 7, 8, 9)
            for point, normal in zip(POINTS, NORMALS, strict=True)
        )
    columns = b"".join(column.astype("<f4").tobytes() for column in NORMALS.T)
    columns += b"".join(column.astype("<f4").tobytes() for column in POINTS.T)
    columns += struct.pack("<3H", 7, 8, 9) * 40
    packed = lzf_literals(columns)
    return header + struct.pack("<II", len(packed), len(columns)) + packed


def npy(array: NDArray[np.generic]) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def npz(**arrays: NDArray[np.generic]) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def seeds() -> dict[str, bytes]:
    """One valid file of every kind that is read."""
    forms = ("ascii", "binary_little_endian", "binary_big_endian")
    files = {f"ply {form}": ply(form) for form in forms}
    files |= {
        f"ply {form} faces {where}": ply(form, where)
        for form in forms
        for where in ("before", "after")
    }
    files |= {f"ply {form} lists inside": ply(form, "inside") for form in forms[1:]}
    files |= {f"pcd {data}": pcd(data) for data in ("ascii", "binary", "binary_compressed")}
    files |= {
        "xyz": text_rows(POINTS),
        "csv": b"name,x,y,z\n"
        + b"".join(b"p," + row + b"\n" for row in text_rows(POINTS, ",").splitlines()),
        "npy": npy(POINTS),
        "npz": npz(points=POINTS, normals=NORMALS),
    }
    return files
