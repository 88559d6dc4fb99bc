"""Writer of binary PLY files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from service.formats.writers.outgoing import Outgoing, to_rows

_TYPES = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort",
    "i4": "int", "u4": "uint", "f4": "float", "f8": "double",
}  # fmt: skip
_MAX_EXACT = 1 << 53
"""Largest whole number up to which double holds each."""


def write(path: Path, cloud: Outgoing) -> None:
    """Write a binary little-endian file; 64-bit integers, which PLY lacks, become double."""
    cloud.use_8_bit_colors()
    cloud.rename()
    _widen_integers(cloud)
    rows = to_rows(cloud.points, cloud.columns)
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    lines += [f"property {_TYPES[rows[n].dtype.str[1:]]} {n}" for n in rows.dtype.names or ()]
    if cloud.faces is not None:
        lines += [f"element face {len(cloud.faces)}", "property list uchar int vertex_indices"]
    with path.open("wb") as file:
        file.write("\n".join([*lines, "end_header\n"]).encode())
        file.write(rows.tobytes())
        if cloud.faces is not None:
            triangles = np.empty(len(cloud.faces), [("count", "u1"), ("corners", "<i4", 3)])
            triangles["count"], triangles["corners"] = 3, cloud.faces
            file.write(triangles.tobytes())


def _widen_integers(cloud: Outgoing) -> None:
    for name, column in cloud.columns.items():
        if column.dtype.str[1:] in _TYPES:
            continue
        if len(column) and max(abs(int(column.min())), abs(int(column.max()))) > _MAX_EXACT:
            cloud.notes.append(f"{name[:40]!r} is rounded: PLY has no integers of 64 bits")
        cloud.columns[name] = column.astype(np.float64)
