"""HDF5 files and MATLAB files of version 7.3, read by h5py: data sets by their names.

Links and data in other files are not followed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.array_cloud import is_transposed
from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count, iter_ranges
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    UnsupportedFileError,
    short_reason,
)
from service.formats.libraries import import_library
from service.formats.named_arrays import choose_array, cloud_of_arrays, find_axis_arrays

MAGIC = b"\x89HDF\r\n\x1a\n"
_MATLAB_BLOCK_BYTES = 512
"""Bytes that MATLAB 7.3 puts before the HDF5 file."""
_MAX_DATA_SETS = 1000
_VALUES_PER_POINT = 16
"""Numbers of a data set for each point of the limit."""
_MIN_ALLOWED_BYTES = 1 << 20
"""Expanded bytes that are allowed whatever the ratio; ratios of small files say nothing."""
_MATLAB_CLASS = "MATLAB_class"


def sniff(head: bytes) -> bool:
    """Whether it is HDF5, or MATLAB 7.3, which is HDF5 behind a text."""
    return head.startswith(MAGIC) or head[_MATLAB_BLOCK_BYTES:].startswith(MAGIC)


def read(
    path: Path,
    limits: ReadLimits,
    scan: int | None,
    weights: str | None = None,
    array: str | None = None,
    *,
    attributes: bool = False,
) -> DecodedCloud:
    """Read the data set called points, xyz, ..., or the only one, and the data set "normals".

    `array` names another data set of points. `scan` selects one of several clouds of equal size,
    (K, N, 3 or more). `weights` names a data set to keep as an attribute; `attributes` keeps all
    with one number or a few for each point.

    Raises
    ------
    CloudFileError
        The file is damaged, or its data sets have other names, shapes or types.
    """
    with _open_sets(path, scan, limits) as sets:
        arrays = {name: item.read for name, item in sets.items()}
        return cloud_of_arrays(arrays, "hdf5", weights, array, attributes=attributes)


def read_pieces(
    path: Path,
    limits: ReadLimits,
    scan: int | None,
    weights: str | None = None,
    array: str | None = None,
    *,
    attributes: bool = False,
) -> Iterator[DecodedCloud]:
    """Read as `read` does, in consecutive pieces."""
    with _open_sets(path, scan, limits) as sets:
        axes = find_axis_arrays(sets) if array is None else None
        name = axes[0] if axes else choose_array(sets, array)
        count = sets[name].count
        fit = {key: item for key, item in sets.items() if item.count == count}
        lost = len(sets) - len(fit)
        warnings = (f"{lost} data sets of another length are ignored",) if lost else ()
        column_names: list[str] = []
        for rows in iter_ranges(count, sum(item.row_bytes for item in fit.values())):
            piece = cloud_of_arrays(
                {key: partial(item.read, rows) for key, item in fit.items()},
                "hdf5",
                weights,
                None if axes else name,
                attributes=attributes,
                column_names=column_names,
            )
            yield replace(piece, warnings=warnings + piece.warnings)


@contextmanager
def _open_sets(path: Path, scan: int | None, limits: ReadLimits) -> Iterator[dict[str, _DataSet]]:
    """Open the data sets of real numbers, by their paths."""
    h5py = import_library("h5py")
    with _translate_errors(), h5py.File(path, "r") as file:
        sets = _find_data_sets(h5py, file)
        yield {name: _DataSet(item, scan, limits) for name, item in sets.items()}


@dataclass(frozen=True, slots=True)
class _DataSet:
    """A data set, or the chosen one of the clouds in it."""

    item: Any
    scan: int | None
    limits: ReadLimits

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape as it is stored; without the number of clouds."""
        shape: tuple[int, ...] = self.item.shape
        return shape[1:] if self._holds_clouds else shape

    @property
    def count(self) -> int:
        """Number of points, if it is one row, column or record for each."""
        return self.shape[self._axis]

    @property
    def row_bytes(self) -> int:
        """Bytes of what belongs to a point."""
        return int(self.item.dtype.itemsize) * prod(self.shape) // max(1, self.count)

    def read(self, rows: range | None = None) -> NDArray[np.generic]:
        """Return the array, or what belongs to some of its points, as rows.

        Raises
        ------
        CloudFileError
            It is too large, refers to other files, or none of its clouds is chosen.
        """
        name = str(self.item.name)[:80]
        if self.item.external or self.item.is_virtual:
            raise UnsupportedFileError(
                f"{name!r} refers to data in other files; expected them inside"
            )
        cloud = self._choose_cloud(name)
        _check_size(self.item, prod(self.shape) if rows is None else 0, self.limits)
        if rows is None:
            whole: NDArray[np.generic] = self.item[cloud]
            return whole.T if self._is_matlab else whole
        before = (slice(None),) * self._axis
        part: NDArray[np.generic] = self.item[(*cloud, *before, slice(rows.start, rows.stop))]
        return part.T if self._axis else part

    @property
    def _holds_clouds(self) -> bool:
        return bool(self.item.ndim == 3 and self.item.shape[2] >= 3)

    @property
    def _is_matlab(self) -> bool:
        return _MATLAB_CLASS in self.item.attrs

    @property
    def _axis(self) -> int:
        """Index of the shape along which the points run."""
        if len(self.shape) != 2:
            return 0
        shape = self.shape[::-1] if self._is_matlab else self.shape
        is_turned = shape[0] == 1 or is_transposed(shape)
        return int(is_turned != self._is_matlab)

    def _choose_cloud(self, name: str) -> tuple[int, ...]:
        """Return the index of the cloud in the data set; nothing where it is no set of clouds."""
        if not self._holds_clouds:
            return ()
        count, size, _ = self.item.shape
        if self.scan is None and count > 1:
            raise UnsupportedFileError(
                f"{name!r} holds {count} clouds of {size} points: set 'scan' to the number of "
                "one, from 0"
            )
        scan = self.scan or 0
        if not 0 <= scan < count:
            raise MalformedFileError(f"scan {scan} does not exist; the file has {count}, from 0")
        return (scan,)


def _find_data_sets(h5py: Any, file: Any) -> dict[str, Any]:
    """Return the data sets of real numbers by their paths."""
    found: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.ndim and item.dtype.kind in "fiuV":
            found[name] = item
        if len(found) > _MAX_DATA_SETS:
            raise FileLimitError(f"the file has more than {_MAX_DATA_SETS} data sets")

    file.visititems(visit)
    return {name: item for name, item in found.items() if not name.startswith("#refs#/")}


def _check_size(item: Any, count: int, limits: ReadLimits) -> None:
    """Check the numbers to be read against the limit, and against the bytes that are stored."""
    name, stored = str(item.name)[:80], item.id.get_storage_size()
    allowed = max(_MIN_ALLOWED_BYTES, limits.max_expansion * stored)
    if item.nbytes > allowed:
        raise FileLimitError(
            f"{name!r} expands from {stored} to {item.nbytes} bytes; the limit is {allowed}"
        )
    check_count(-(-count // _VALUES_PER_POINT), 0, 0, repr(name), limits)


@contextmanager
def _translate_errors() -> Iterator[None]:
    """Turn the errors of h5py on damaged files into MalformedFileError."""
    try:
        yield
    except (CloudFileError, MemoryError):
        raise
    except Exception as error:  # noqa: BLE001  h5py raises nearly anything on damaged files
        reason = short_reason(error)
        raise MalformedFileError(
            f"the HDF5 file cannot be read: {reason}; is it complete? Else save the points as .npy"
        ) from None
