"""Writer of NumPy arrays."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.writers.outgoing import Outgoing, to_rows
from service.formats.writers.row_format import RowFormat

_MAX_SHORT_BYTES = 65_000
"""Text of a header of version 1.0, which counts its bytes with 16 bits."""


def _encode(cloud: Outgoing) -> NDArray[Any]:
    """Return an (N, 3) array; with attributes a structured one with the fields x, y, z, ..."""
    cloud.drop_faces()
    if cloud.columns:
        return to_rows(cloud.points, cloud.columns)
    return np.ascontiguousarray(cloud.points)


def _header(_: Outgoing, rows: NDArray[Any], count: int) -> bytes:
    """Return a header of version 1.0, or 2.0 where it is long; other letters are escaped in it."""
    shape = (count, *rows.shape[1:])
    descr = np.lib.format.dtype_to_descr(rows.dtype)
    text = ascii({"descr": descr, "fortran_order": False, "shape": shape}).encode()
    version, length = (1, "<H") if len(text) < _MAX_SHORT_BYTES else (2, "<I")
    start = np.lib.format.magic(version, 0)
    before = len(start) + struct.calcsize(length)
    text += b" " * (-(before + len(text) + 1) % np.lib.format.ARRAY_ALIGN) + b"\n"
    return start + struct.pack(length, len(text)) + text


NPY = RowFormat(_encode, _header)
