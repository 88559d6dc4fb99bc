"""HDF5 files and MATLAB files of version 7.3, read by h5py: data sets by their names.

Links and data in other files are not followed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    UnsupportedFileError,
    short_reason,
)
from service.formats.libraries import import_library
from service.formats.named_arrays import cloud_of_arrays

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
    *,
    attributes: bool = False,
) -> DecodedCloud:
    """Read the data set called points, xyz, ..., or the only one, and the data set "normals".

    `scan` selects one of several clouds of equal size, (K, N, 3 or more). `weights` names a data
    set to keep as an attribute; `attributes` keeps all with one number or a few for each point.

    Raises
    ------
    CloudFileError
        The file is damaged, or its data sets have other names, shapes or types.
    """
    h5py = import_library("h5py")
    with _translate_errors(), h5py.File(path, "r") as file:
        sets = _find_data_sets(h5py, file)
        arrays = {name: partial(_read, item, scan, limits) for name, item in sets.items()}
        return cloud_of_arrays(arrays, "hdf5", weights, attributes=attributes)


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


def _read(item: Any, scan: int | None, limits: ReadLimits) -> NDArray[np.generic]:
    name = str(item.name)[:80]
    if item.external or item.is_virtual:
        raise UnsupportedFileError(f"{name!r} refers to data in other files; expected them inside")
    if item.ndim == 3 and item.shape[2] >= 3 and item.shape[0] > 1:
        return _read_cloud(item, scan, limits)
    _check_size(item, item.size, limits)
    array: NDArray[np.generic] = item[()]
    return array.T if _MATLAB_CLASS in item.attrs else array


def _read_cloud(item: Any, scan: int | None, limits: ReadLimits) -> NDArray[np.generic]:
    count = item.shape[0]
    if scan is None:
        raise UnsupportedFileError(
            f"{str(item.name)[:80]!r} holds {count} clouds of {item.shape[1]} points: "
            "set 'scan' to the number of one, from 0"
        )
    if not 0 <= scan < count:
        raise MalformedFileError(f"scan {scan} does not exist; the file has {count}, from 0")
    _check_size(item, item.size // count, limits)
    array: NDArray[np.generic] = item[scan]
    return array


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
