"""Writer of binary PCD files with the names and types that PCL expects."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB, pack_colors
from service.formats.column_names import find_normals
from service.formats.decoded_cloud import UNMOVED
from service.formats.writers.outgoing import Columns, Outgoing, to_rows
from service.formats.writers.row_format import RowFormat

_NORMALS = ("normal_x", "normal_y", "normal_z")
_FORBIDDEN = re.compile(r"[\s\x00-\x1f\x7f]|^_$")


def _encode(cloud: Outgoing) -> NDArray[np.void]:
    """Return the rows; coordinates in float32, which is all that PCL and Open3D read."""
    cloud.drop_faces()
    cloud.use_float32()
    cloud.use_8_bit_colors()
    cloud.columns = _rename_normals(cloud.columns)
    if all(name in cloud.columns for name in RGB):
        cloud.columns["rgb"] = pack_colors(cloud.take(RGB).astype(np.uint8))
    intensity = cloud.columns.get("intensity")
    if intensity is not None and (intensity.astype(np.float32) == intensity).all():
        cloud.columns["intensity"] = intensity.astype(np.float32)  # PCL's type of it
    cloud.rename(_FORBIDDEN)
    return to_rows(cloud.points, cloud.columns)


def _header(cloud: Outgoing, rows: NDArray[np.void], count: int) -> bytes:
    names = rows.dtype.names or ()
    codes = [rows[name].dtype.str[1:].upper() for name in names]
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        f"FIELDS {' '.join(names)}",
        f"SIZE {' '.join(code[1] for code in codes)}",
        f"TYPE {' '.join(code[0] for code in codes)}",
        f"COUNT {' '.join('1' for _ in codes)}",
        f"WIDTH {count}",
        "HEIGHT 1",
        f"VIEWPOINT {' '.join(f'{value:.17g}' for value in cloud.viewpoint or UNMOVED)}",
        f"POINTS {count}",
        "DATA binary\n",
    ]
    return "\n".join(lines).encode()


def _rename_normals(columns: Columns) -> Columns:
    names = list(columns)
    places = find_normals(names)
    if places is None or set(_NORMALS) & set(names):
        return columns
    new = dict(zip((names[i] for i in places), _NORMALS, strict=True))
    return {new.get(name, name): column for name, column in columns.items()}


PCD = RowFormat(_encode, _header)
