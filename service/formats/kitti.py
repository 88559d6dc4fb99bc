"""KITTI .bin: rows of x, y, z, intensity in float32, without a header; read only if declared."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import MalformedFileError
from service.formats.memory_map import map_file

_ROW_BYTES = 16
_MAX_NEGATIVE = 0.01
"""Share of rows with a negative intensity; more of them contradict four columns."""
_MAX_RANGE = 1e5
"""Metres; float32 beyond it is no coordinate of a scanner."""


def are_float_rows(head: bytes) -> bool:
    """Whether the bytes are plausible as float32 numbers of a scanner."""
    values = np.frombuffer(head[: len(head) // 4 * 4], "<f4")
    sizes = np.abs(values[np.isfinite(values)])
    plausible = (sizes < _MAX_RANGE) & ((sizes > 1e-9) | (sizes == 0))
    return len(values) >= 16 and plausible.sum() > 0.98 * len(values) and bool(sizes.any())


def read(path: Path, limits: ReadLimits, *, attributes: bool = False) -> DecodedCloud:
    """Read all rows; `attributes` adds their intensity.

    Raises
    ------
    MalformedFileError
        The length is no multiple of 16 bytes, or column 4 holds no intensities.
    """
    size = path.stat().st_size
    if size % _ROW_BYTES:
        raise MalformedFileError(
            f"the file has {size} bytes; expected a multiple of {_ROW_BYTES}: "
            "rows of four columns (x, y, z, intensity) in float32; save rows with "
            "another number of columns as .npy"
        )
    check_count(size // _ROW_BYTES, _ROW_BYTES, size, "the file", limits)
    rows = np.frombuffer(map_file(path), "<f4").reshape(-1, 4)
    negative = int((rows[:, 3] < 0).sum())
    if negative > _MAX_NEGATIVE * len(rows):
        raise MalformedFileError(
            f"{negative} of {len(rows)} rows have a negative intensity in column 4; expected rows "
            "of x, y, z, intensity: save rows with another number of columns as .npy"
        )
    kept: dict[str, NDArray[np.generic]] = {"intensity": rows[:, 3].astype(np.float32)}
    points = rows[:, :3].astype(np.float32)
    return DecodedCloud(points, "kitti", attributes=kept if attributes else {})
