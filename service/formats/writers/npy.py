"""Writer of NumPy arrays."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.writers.outgoing import Outgoing, to_rows
from service.formats.writers.row_format import RowFormat


def _encode(cloud: Outgoing) -> NDArray[Any]:
    """Return an (N, 3) array; with attributes a structured one with the fields x, y, z, ..."""
    cloud.drop_faces()
    if cloud.columns:
        return to_rows(cloud.points, cloud.columns)
    return np.ascontiguousarray(cloud.points)


def _header(_: Outgoing, rows: NDArray[Any], count: int) -> bytes:
    file = io.BytesIO()
    description = np.lib.format.dtype_to_descr(rows.dtype)
    np.lib.format.write_array_header_1_0(
        file,
        {"descr": description, "fortran_order": False, "shape": (count, *rows.shape[1:])},
    )
    return file.getvalue()


NPY = RowFormat(_encode, _header)
