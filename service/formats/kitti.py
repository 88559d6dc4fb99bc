"""Rows of float32 without a header (.bin), as of KITTI and nuScenes; read only if declared."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import (
    UNMOVED,
    DecodedCloud,
    ReadLimits,
    check_count,
    iter_ranges,
)
from service.formats.errors import MalformedFileError
from service.formats.memory_map import map_file

MIN_COLUMNS, MAX_COLUMNS = 3, 8
_KITTI_COLUMNS = 4
_MAX_NEGATIVE = 0.01
"""Share of rows with a negative intensity; more of them contradict four columns."""
_MAX_RANGE = 1e5
"""Metres; float32 beyond it is no coordinate of a scanner."""
_MIN_PLAUSIBLE = 0.98
"""Share of numbers that a scanner may have measured."""
_DECLARE = "set 'columns' to the number of columns, 3 to 8, or save the array as .npy"


def are_float_rows(head: bytes) -> bool:
    """Whether the bytes are plausible as float32 numbers of a scanner."""
    values = np.frombuffer(head[: len(head) // 4 * 4], "<f4")
    return len(values) >= 16 and _are_plausible(values)


def read(
    path: Path, limits: ReadLimits, columns: int | None, *, attributes: bool = False
) -> DecodedCloud:
    """Read all rows of x, y, z and others; `attributes` adds the others.

    `columns` is the number of columns; None: four, the fourth of which is the intensity.

    Raises
    ------
    MalformedFileError
        The length is no multiple of the row's, or the numbers are no coordinates or intensities.
    """
    width = columns or _KITTI_COLUMNS
    count = _count_rows(path, limits, width)
    return _read_rows(path, range(count), width, columns, attributes=attributes)


def read_pieces(
    path: Path, limits: ReadLimits, columns: int | None, *, attributes: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read` does, in consecutive pieces."""
    width = columns or _KITTI_COLUMNS
    for rows in iter_ranges(_count_rows(path, limits, width), 4 * width):
        yield _read_rows(path, rows, width, columns, attributes=attributes)


def _count_rows(path: Path, limits: ReadLimits, width: int) -> int:
    size, row_bytes = path.stat().st_size, 4 * width
    if not MIN_COLUMNS <= width <= MAX_COLUMNS:
        raise MalformedFileError(f"columns is {width}; expected {MIN_COLUMNS} to {MAX_COLUMNS}")
    if size % row_bytes:
        raise MalformedFileError(
            f"the file has {size} bytes; expected a multiple of {row_bytes}: "
            f"rows of {width} columns (x, y, z, ...) in float32; {_DECLARE}"
        )
    check_count(size // row_bytes, row_bytes, size, "the file", limits)
    return size // row_bytes


def _read_rows(
    path: Path, wanted: range, width: int, columns: int | None, *, attributes: bool
) -> DecodedCloud:
    content = map_file(path, 4 * width * wanted.start, 4 * width * len(wanted))
    rows = np.frombuffer(content, "<f4").reshape(-1, width)
    if columns is None:
        _check_intensities(rows[:, 3])
    elif not _are_plausible(rows[:, :3]):
        raise MalformedFileError(
            f"as rows of {width} columns the first three are no coordinates below {_MAX_RANGE:g}; "
            "is the number of columns right?"
        )
    names = ["intensity", *(f"column_{number}" for number in range(5, width + 1))]
    kept: dict[str, NDArray[np.generic]] = {}
    if attributes:
        others = zip(names, rows[:, 3:].T, strict=False)
        kept = {name: column.astype(np.float32) for name, column in others}
    points = rows[:, :3].astype(np.float32)
    return DecodedCloud(points, "kitti", viewpoints=(UNMOVED,), attributes=kept)


def _check_intensities(column: NDArray[np.float32]) -> None:
    negative = int((column < 0).sum())
    if negative > _MAX_NEGATIVE * len(column):
        raise MalformedFileError(
            f"{negative} of {len(column)} rows have a negative intensity in column 4; expected "
            f"rows of x, y, z, intensity: {_DECLARE}"
        )


def _are_plausible(values: NDArray[np.float32]) -> bool:
    sizes = np.abs(values[np.isfinite(values)])
    plausible = (sizes < _MAX_RANGE) & ((sizes > 1e-9) | (sizes == 0))
    return plausible.sum() > _MIN_PLAUSIBLE * values.size and bool(sizes.any())
