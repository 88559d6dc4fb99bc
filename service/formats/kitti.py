"""KITTI's .bin: rows of x, y, z, intensity in float32, without any header; only if declared."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from service.formats.decoded_cloud import DecodedCloud, Limits, check_count
from service.formats.errors import MalformedFileError
from service.formats.memory_map import mapped

_ROW = 16


def read(path: Path, limits: Limits) -> DecodedCloud:
    """Read all rows.

    Raises
    ------
    MalformedFileError
        The length is no multiple of 16 bytes.
    """
    size = path.stat().st_size
    if size % _ROW:
        raise MalformedFileError(f"{size} bytes are no whole number of rows of {_ROW} bytes")
    check_count(size // _ROW, _ROW, size, "the file", limits)
    rows = np.frombuffer(mapped(path), "<f4").reshape(-1, 4)
    return DecodedCloud(rows[:, :3].astype(np.float32), "kitti")
