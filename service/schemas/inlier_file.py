"""The file of all inlier pairs of a result: NPY, one structured row a pair.

`numpy.load` parses the header as Python, which may fail in Python 3.11 while another thread does
so too (python/cpython#106905), or at a header that was made to. So only the header that these rows
have is read.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from mpe_core import Inliers

INLIER_DTYPE = np.dtype([("source", "<i8"), ("target", "<i8"), ("distance", "<f8")])
"""Row of the file; distances in the unit of the input."""


def write_inliers(path: Path, inliers: Inliers) -> None:
    """Write the pairs; unlike `numpy.save`, tell that the disk is full."""
    rows = np.empty(len(inliers), INLIER_DTYPE)
    rows["source"], rows["target"] = inliers.source, inliers.target
    rows["distance"] = inliers.distance
    with path.open("wb") as file:
        file.write(header_of(len(rows)))
        file.write(rows.view(np.uint8).data)


def read_inliers(path: Path) -> NDArray[np.void]:
    """Map the rows (K,) of the file.

    Raises
    ------
    ValueError
        If it is not as `write_inliers` writes it.
    """
    start = len(header_of(0))
    count, rest = divmod(path.stat().st_size - start, INLIER_DTYPE.itemsize)
    with path.open("rb") as file:
        if rest or count < 0 or file.read(start) != header_of(count):
            raise ValueError("the file of inlier pairs is not as it was written")
    if count == 0:
        return np.empty(0, INLIER_DTYPE)
    return np.memmap(path, INLIER_DTYPE, "r", offset=start, shape=(count,))


def header_of(count: int) -> bytes:
    """Header of a file of `count` rows; it has the same length whatever their number."""
    buffer = io.BytesIO()
    descr = npy.dtype_to_descr(INLIER_DTYPE)
    layout = {"descr": descr, "fortran_order": False, "shape": (count,)}
    npy.write_array_header_1_0(buffer, layout)
    return buffer.getvalue()
