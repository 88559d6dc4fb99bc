"""NumPy .npy and .npz files, without pickles."""

from __future__ import annotations

import io
import lzma
import struct
import sys
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from math import prod
from pathlib import Path
from typing import IO, Literal

import numpy as np
from numpy.typing import NDArray

from service.formats.array_cloud import all_fields, extra_fields, to_cloud, with_attribute
from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count, iter_ranges
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    TruncatedFileError,
    UnsupportedFileError,
    short_reason,
)
from service.formats.named_arrays import cloud_of_arrays
from service.formats.npy_pieces import ArrayHeader, ArrayRows

MAGIC = b"\x93NUMPY"
_MAX_HEADER_BYTES = 1 << 16
_MAX_MEMBERS = 1000
_HEADER_ERRORS = (
    ValueError,
    TypeError,
    SyntaxError,
    RecursionError,
    MemoryError,  # raised by the parser for deep nesting
    OverflowError,
    tokenize.TokenError,
)
_ZIP_ERRORS = (
    ValueError,
    KeyError,
    IndexError,
    OverflowError,
    EOFError,
    OSError,
    RuntimeError,  # encryption or unknown compression
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
)
_MIN_ALLOWED_BYTES = 1 << 20
"""Expanded bytes that are allowed whatever the ratio; ratios of small files say nothing."""


def read_npy(
    path: Path, limits: ReadLimits, weights: str | None = None, *, attributes: bool = False
) -> DecodedCloud:
    """Read an (N, 3 or more) or (H, W, 3) array, or a structured one with the fields x, y, z.

    `weights` names a field to keep as an attribute, `attributes` keeps all fields and columns.

    Raises
    ------
    CloudFileError
        The file is damaged, or its array has another shape or type.
    """
    with path.open("rb") as file:
        array = _read_array(file, path.stat().st_size, "the array", limits)
    return _make_cloud(array, weights, attributes=attributes)


def read_npy_pieces(
    path: Path, limits: ReadLimits, weights: str | None = None, *, attributes: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read_npy` does, in consecutive pieces.

    Raises
    ------
    UnsupportedFileError
        The points lie scattered in the file.
    """
    with path.open("rb") as file:
        header = _read_header(file, path.stat().st_size, "the array", limits)
    rows, names = ArrayRows.of(path, header), list[str]()
    for wanted in iter_ranges(rows.count, rows.row_bytes):
        yield _make_cloud(rows.read(wanted), weights, attributes=attributes, names=names)


def _make_cloud(
    array: NDArray[np.generic],
    weights: str | None,
    *,
    attributes: bool,
    names: list[str] | None = None,
) -> DecodedCloud:
    """Make a cloud of an array; `names` is as that of `name_columns`."""
    cloud = to_cloud(array, "npy")
    if attributes:
        told = tuple(text for text in cloud.warnings if "ignored" not in text)
        flat = array.reshape(-1) if array.dtype.names else array
        kept = all_fields(flat, len(cloud.points), names)
        cloud = replace(cloud, warnings=told, attributes=kept)
    return cloud if weights is None else with_attribute(cloud, weights, extra_fields(array))


def read_npz(
    path: Path,
    limits: ReadLimits,
    weights: str | None = None,
    array: str | None = None,
    *,
    attributes: bool = False,
) -> DecodedCloud:
    """Read the array called points, xyz, ..., or the only one, and the array "normals".

    `array` names another array of points. `weights` names an array, or a field of the array of
    points, to keep as an attribute; `attributes` keeps all arrays with one number or three for
    each point. The zip directory is checked before anything is expanded.

    Raises
    ------
    CloudFileError
        The archive is damaged, or its arrays have other names, shapes or types.
    """
    with _translate_errors("the zip archive", _ZIP_ERRORS), zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        if len(members) > _MAX_MEMBERS:
            raise FileLimitError(
                f"the archive has {len(members)} members; the limit is {_MAX_MEMBERS}"
            )
        arrays = {
            info.filename.removesuffix(".npy"): partial(_read_member, archive, info, limits)
            for info in members
            if info.filename.endswith(".npy")
        }
        return cloud_of_arrays(arrays, "npz", weights, array, attributes=attributes)


def _read_member(
    archive: zipfile.ZipFile, info: zipfile.ZipInfo, limits: ReadLimits
) -> NDArray[np.generic]:
    allowed = max(_MIN_ALLOWED_BYTES, limits.max_expansion * info.compress_size)
    if info.file_size > allowed:
        raise FileLimitError(
            f"{info.filename[:80]!r} expands from {info.compress_size} to {info.file_size} bytes; "
            f"the limit is {allowed}"
        )
    with archive.open(info) as file:
        array = _read_array(file, info.file_size, repr(info.filename[:80]), limits)
        if file.read(1):  # reaching the end also checks the CRC
            raise MalformedFileError(f"{info.filename[:80]!r} has bytes after the array")
    return array


def _read_array(file: IO[bytes], size: int, name: str, limits: ReadLimits) -> NDArray[np.generic]:
    header = _read_header(file, size, name, limits)
    count = prod(header.shape)
    content = file.read(count * header.dtype.itemsize)
    if len(content) < count * header.dtype.itemsize:
        raise TruncatedFileError(f"{name} of shape {header.shape} ends after {len(content)} bytes")
    order: Literal["F", "C"] = "F" if header.fortran else "C"
    return np.frombuffer(content, header.dtype).reshape(header.shape, order=order)


def _read_header(file: IO[bytes], size: int, name: str, limits: ReadLimits) -> ArrayHeader:
    """Read the header, and check that the numbers fit into the file and the limits."""
    with _translate_errors(f"the header of {name}", _HEADER_ERRORS):
        version = np.lib.format.read_magic(file)
        if version == (1, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
        elif version == (2, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_2_0(file)
        elif version == (3, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_2_0(_to_version_2(file))
        else:
            raise UnsupportedFileError(f"{name} has .npy version {version}; expected 1.0 to 3.0")
    if dtype.hasobject:
        raise UnsupportedFileError(
            f"{name} holds pickled objects, which are never loaded; expected numbers"
        )
    if dtype.itemsize == 0 or dtype.subdtype is not None:
        raise MalformedFileError(f"{name} has elements of type {str(dtype)[:40]}; expected numbers")
    if any(type(length) is not int or not 0 <= length <= sys.maxsize for length in shape):
        raise MalformedFileError(f"{name} has the invalid shape {shape}")
    count = prod(shape)
    offset, at = file.tell(), f"{name} of shape {shape}"
    check_count(count, dtype.itemsize, size - offset, at, _values_limit(limits))
    return ArrayHeader(shape, fortran, dtype, offset)


def _to_version_2(file: IO[bytes]) -> IO[bytes]:
    """Return a header of version 3.0, whose names are in UTF-8, with these escaped instead."""
    length = int.from_bytes(file.read(4), "little")
    text = file.read(min(length, _MAX_HEADER_BYTES)).decode()
    escaped = text.encode("ascii", errors="backslashreplace")
    return io.BytesIO(len(escaped).to_bytes(4, "little") + escaped)


def _values_limit(limits: ReadLimits) -> ReadLimits:
    """Return limits that count numbers instead of points, up to 16 for each point."""
    return replace(limits, max_points=16 * limits.max_points)


@contextmanager
def _translate_errors(what: str, errors: tuple[type[Exception], ...]) -> Iterator[None]:
    """Turn the errors of zipfile and numpy on damaged files into MalformedFileError."""
    try:
        yield
    except CloudFileError:
        raise
    except errors as error:
        reason = short_reason(error)
        raise MalformedFileError(f"{what} cannot be read: {reason}") from None
