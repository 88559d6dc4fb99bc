"""Writer of binary PLY files."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from service.formats.writers.outgoing import Outgoing, to_rows
from service.formats.writers.row_format import RowFormat

_TYPES = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort",
    "i4": "int", "u4": "uint", "f4": "float", "f8": "double",
}  # fmt: skip
_MAX_EXACT = 1 << 53
"""Largest whole number up to which double holds each."""


def _encode(cloud: Outgoing) -> NDArray[np.void]:
    """Return little-endian rows; 64-bit integers, which PLY lacks, become double."""
    cloud.use_8_bit_colors()
    cloud.rename()
    _widen_integers(cloud)
    return to_rows(cloud.points, cloud.columns)


def _header(cloud: Outgoing, rows: NDArray[np.void], count: int) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    lines += [f"property {_TYPES[rows[n].dtype.str[1:]]} {n}" for n in rows.dtype.names or ()]
    if cloud.faces is not None:
        lines += [f"element face {len(cloud.faces)}", "property list uchar int vertex_indices"]
    return "\n".join([*lines, "end_header\n"]).encode()


def _faces(cloud: Outgoing) -> bytes:
    if cloud.faces is None:
        return b""
    triangles = np.empty(len(cloud.faces), [("count", "u1"), ("corners", "<i4", 3)])
    triangles["count"], triangles["corners"] = 3, cloud.faces
    return triangles.tobytes()


def _widen_integers(cloud: Outgoing) -> None:
    for name, column in cloud.columns.items():
        if column.dtype.str[1:] in _TYPES:
            continue
        if len(column) and max(abs(int(column.min())), abs(int(column.max()))) > _MAX_EXACT:
            cloud.notes.append(f"{name[:40]!r} is rounded: PLY has no integers of 64 bits")
        cloud.columns[name] = column.astype(np.float64)


PLY = RowFormat(_encode, _header, footer=_faces)
