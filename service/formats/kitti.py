"""KITTI .bin: rows of x, y, z, intensity in float32, without a header; read only if declared."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import MalformedFileError
from service.formats.memory_map import map_file

_ROW_BYTES = 16


def read(path: Path, limits: ReadLimits) -> DecodedCloud:
    """Read all rows.

    Raises
    ------
    MalformedFileError
        The length is no multiple of 16 bytes.
    """
    size = path.stat().st_size
    if size % _ROW_BYTES:
        raise MalformedFileError(
            f"the file has {size} bytes; expected a multiple of {_ROW_BYTES}: "
            "rows of four columns (x, y, z, intensity) in float32"
        )
    check_count(size // _ROW_BYTES, _ROW_BYTES, size, "the file", limits)
    rows = np.frombuffer(map_file(path), "<f4").reshape(-1, 4)
    return DecodedCloud(rows[:, :3].astype(np.float32), "kitti")
