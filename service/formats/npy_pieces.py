"""Rows of a large array of an .npy file, read some at a time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.array_cloud import is_transposed
from service.formats.errors import UnsupportedFileError
from service.formats.memory_map import map_file


@dataclass(frozen=True, slots=True)
class ArrayHeader:
    """What an .npy file says before its numbers."""

    shape: tuple[int, ...]
    fortran: bool
    """Whether the first index runs fastest."""
    dtype: np.dtype[np.generic]
    offset: int
    """Byte of the first number."""


@dataclass(frozen=True, slots=True)
class ArrayRows:
    """The points of an array: its rows, one after the other or column by column."""

    path: Path
    header: ArrayHeader
    count: int
    """Number of points."""
    width: tuple[int, ...]
    """Shape of a point: numbers, or nothing for records."""
    by_column: bool
    """Whether the file holds one column after the other."""

    @classmethod
    def of(cls, path: Path, header: ArrayHeader) -> ArrayRows:
        """Find the points in the shape.

        Raises
        ------
        UnsupportedFileError
            They lie scattered in the file.
        """
        shape, by_column = header.shape, header.fortran and len(header.shape) > 1
        if header.dtype.names is None and is_transposed(shape):
            shape, by_column = shape[::-1], not by_column
        is_table = header.dtype.names is None and len(shape) > 1
        width = shape[-1:] if is_table else ()
        if by_column and (len(shape) != 2 or not is_table):
            raise UnsupportedFileError(
                f"an array of shape {header.shape} in Fortran order has too many points for the "
                "memory allowed: save it in C order"
            )
        count = int(np.prod(shape[:-1] if is_table else shape, dtype=object))
        return cls(path, header, count, width, by_column)

    @property
    def row_bytes(self) -> int:
        """Bytes of a point."""
        return self.header.dtype.itemsize * int(np.prod(self.width, dtype=np.int64))

    def read(self, rows: range) -> NDArray[np.generic]:
        """Return consecutive rows (n, ...)."""
        if not self.by_column:
            flat = self._read_flat(rows.start * self.row_bytes, len(rows) * self.row_bytes)
            return flat.reshape(len(rows), *self.width)
        size = self.header.dtype.itemsize
        columns = [
            self._read_flat((column * self.count + rows.start) * size, len(rows) * size)
            for column in range(self.width[0])
        ]
        return np.stack(columns, axis=1)

    def _read_flat(self, start: int, size: int) -> NDArray[np.generic]:
        content = map_file(self.path, self.header.offset + start, size)
        return np.frombuffer(content, self.header.dtype)
