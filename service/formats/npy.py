"""NumPy .npy and .npz files, without pickles."""

from __future__ import annotations

import lzma
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import IO, cast

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB
from service.formats.column_names import find_normals, find_xyz
from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import (
    CloudFileError,
    FileLimitError,
    MalformedFileError,
    MissingAttributeError,
    TruncatedFileError,
    UnsupportedFileError,
    missing_attribute,
    short_reason,
)
from service.formats.unnamed_columns import name_columns

MAGIC = b"\x93NUMPY"
_POINT_ARRAYS = (
    *("points", "xyz", "pcd", "positions", "vertices", "coords", "coord", "coordinates", "pc"),
    *("pos", "position", "point", "point_cloud", "pointcloud", "cloud", "data", "arr_0"),
)
"""Names of the array of points in an .npz, in order of preference."""
_COLOR_ARRAYS = ("color", "colors", "colour", "colours", "rgb")
_MAX_ARRAYS = 64
"""Arrays beside the points that are kept."""
_MAX_PARTS = 64
"""Numbers of an array for each point that are kept."""
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
    cloud = _to_cloud(array, "npy")
    if attributes:
        told = tuple(text for text in cloud.warnings if "ignored" not in text)
        kept = _all_fields(array.reshape(-1) if array.dtype.names else array, len(cloud.points))
        cloud = replace(cloud, warnings=told, attributes=kept)
    return cloud if weights is None else _with_attribute(cloud, weights, _extra_fields(array))


def read_npz(
    path: Path, limits: ReadLimits, weights: str | None = None, *, attributes: bool = False
) -> DecodedCloud:
    """Read the array called points, xyz, ..., or the only one, and the array "normals".

    `weights` names an array, or a field of the array of points, to keep as an attribute;
    `attributes` keeps all arrays with one number or three for each point. The zip directory is
    checked before anything is expanded.

    Raises
    ------
    CloudFileError
        The archive is damaged, or its arrays have other names, shapes or types.
    """
    with _translate_errors("the zip archive", _ZIP_ERRORS), zipfile.ZipFile(path) as archive:
        arrays = {
            info.filename.removesuffix(".npy"): info
            for info in archive.infolist()
            if info.filename.endswith(".npy")
        }
        name = _choose_array(arrays, len(archive.infolist()))
        array = _read_member(archive, arrays[name], limits)
        cloud = _to_cloud(array, "npz")
        normals = cloud.normals
        if "normals" in arrays:
            normals = _to_cloud(_read_member(archive, arrays["normals"], limits), "npz").points
        known = _extra_fields(array) | dict.fromkeys(sorted(set(arrays) - {name, "normals"}))
        if weights is not None and weights in arrays:
            known[weights] = _read_member(archive, arrays[weights], limits)
        kept = _all_fields(array, len(cloud.points)) if attributes else {}
        used = {name, "normals", weights}
        others = sorted(set(arrays) - {name, "normals"}) if attributes else []
        for other in others[:_MAX_ARRAYS]:
            member = _read_member(archive, arrays[other], limits)
            columns = _array_columns(other, member, len(cloud.points))
            kept |= columns
            used |= {other} if columns else set()
    if normals is not None and len(normals) != len(cloud.points):
        raise MalformedFileError(
            f"the archive has {len(normals)} normals for {len(cloud.points)} points"
        )
    ignored = sorted(set(arrays) - used)
    warnings: tuple[str, ...] = ()
    if ignored:
        warnings = (f"{len(ignored)} arrays beside {name!r} are ignored",)
    if not attributes:
        warnings = cloud.warnings + warnings
    cloud = DecodedCloud(cloud.points, "npz", warnings, normals, attributes=kept)
    return cloud if weights is None else _with_attribute(cloud, weights, known)


def _extra_fields(array: NDArray[np.generic]) -> dict[str, NDArray[np.generic] | None]:
    """Return the fields of a structured array beside the coordinates."""
    names = array.dtype.names or ()
    places = find_xyz(names) or ()
    records = cast("NDArray[np.void]", array)
    return {name: records[name] for i, name in enumerate(names) if i not in places}


def _with_attribute(
    cloud: DecodedCloud, name: str, known: dict[str, NDArray[np.generic] | None]
) -> DecodedCloud:
    """Return the cloud with one of the known attributes."""
    column = known.get(name)
    if column is None:
        raise missing_attribute(name, known)
    if column.shape != (len(cloud.points),) or column.dtype.kind not in "biuf":
        raise MissingAttributeError(
            f"attribute {name[:40]!r} has type {column.dtype} and shape {column.shape}; expected"
            f" one number for each of the {len(cloud.points)} points"
        )
    return replace(cloud, attributes=cloud.attributes | {name: column.astype(np.float64)})


def _all_fields(array: NDArray[np.generic], count: int) -> dict[str, NDArray[np.generic]]:
    """Return the fields, or the columns after the third, that hold one number for each point."""
    if array.dtype.names:
        fields: dict[str, NDArray[np.generic]] = {}
        for name, column in _extra_fields(array).items():
            if column is not None:
                fields |= _array_columns(name, column, count)
        return fields
    if array.ndim != 2 or array.dtype.kind not in "fiu":
        return {}
    table = array.T if _is_transposed(array) else array
    return name_columns(table[:, 3:], 4)


def _array_columns(
    name: str, array: NDArray[np.generic], count: int
) -> dict[str, NDArray[np.generic]]:
    """Return an array of one number or a few for each point as columns; else nothing."""
    if array.dtype.kind not in "biuf" or array.shape[:1] != (count,):
        return {}
    native = array.astype(array.dtype.newbyteorder("="))
    if array.ndim == 1:
        return {name: native}
    if array.ndim != 2 or array.shape[1] > _MAX_PARTS:
        return {}
    if array.shape[1] == 3 and name.lower() in _COLOR_ARRAYS:
        return dict(zip(RGB, native.T, strict=True))
    return {f"{name}:{i}": native[:, i] for i in range(array.shape[1])}


def _choose_array(arrays: dict[str, zipfile.ZipInfo], members: int) -> str:
    if members > _MAX_MEMBERS:
        raise FileLimitError(f"the archive has {members} members; the limit is {_MAX_MEMBERS}")
    for name in _POINT_ARRAYS:
        if name in arrays:
            return name
    if len(arrays) == 1:
        return next(iter(arrays))
    raise MalformedFileError(
        f"the archive has {len(arrays)} arrays; expected only one, or one called "
        f"{', '.join(_POINT_ARRAYS)}"
    )


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
    with _translate_errors(f"the header of {name}", _HEADER_ERRORS):
        version = np.lib.format.read_magic(file)
        if version == (1, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
        elif version == (2, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_2_0(file)
        else:
            raise UnsupportedFileError(f"{name} has .npy version {version}; expected 1.0 or 2.0")
    if dtype.hasobject:
        raise UnsupportedFileError(
            f"{name} holds pickled objects, which are never loaded; expected numbers"
        )
    if dtype.itemsize == 0 or dtype.subdtype is not None:
        raise MalformedFileError(f"{name} has elements of type {str(dtype)[:40]}; expected numbers")
    if any(type(length) is not int or length < 0 for length in shape):  # True is no length
        raise MalformedFileError(f"{name} has the invalid shape {shape}")
    count = prod(shape)
    at = f"{name} of shape {shape}"
    check_count(count, dtype.itemsize, size - file.tell(), at, _values_limit(limits))
    content = file.read(count * dtype.itemsize)
    if len(content) < count * dtype.itemsize:
        raise TruncatedFileError(f"{at} ends after {len(content)} bytes")
    return np.frombuffer(content, dtype).reshape(shape, order="F" if fortran else "C")


def _values_limit(limits: ReadLimits) -> ReadLimits:
    """Return limits that count numbers instead of points, up to 16 for each point."""
    return replace(limits, max_points=16 * limits.max_points)


def _to_cloud(array: NDArray[np.generic], format: str) -> DecodedCloud:
    if array.dtype.names:
        names = array.dtype.names
        xyz, normals = find_xyz(names), find_normals(names)
        if xyz is None or array.ndim not in (1, 2):
            raise MalformedFileError(
                f"a structured array of {array.ndim} dimensions with the fields {names[:9]}; "
                "expected one or two dimensions and the fields x, y, z"
            )
        records = cast("NDArray[np.void]", array.reshape(-1))
        for i in xyz + (normals or ()):
            if (shape := records[names[i]].shape[1:]) != ():
                raise MalformedFileError(
                    f"the field {names[i]} holds values of shape {shape}; expected one number"
                )
        table = np.stack([_floats(records[names[i]]) for i in xyz + (normals or ())], axis=1)
        return DecodedCloud(table[:, :3], format, (), table[:, 3:] if normals else None)
    if array.ndim == 3 and array.shape[2] == 3:
        return DecodedCloud(_floats(array.reshape(-1, 3)), format)
    if array.ndim != 2 or array.shape[1] < 3:
        raise MalformedFileError(f"an array of shape {array.shape}; expected (N, 3)")
    if _is_transposed(array):
        return DecodedCloud(
            _floats(array[:3].T), format, (f"the shape {array.shape} is read as its transpose",)
        )
    extra = array.shape[1] - 3
    warnings = (f"{extra} columns after x, y, z are ignored",) if extra else ()
    return DecodedCloud(_floats(array[:, :3]), format, warnings)


def _is_transposed(array: NDArray[np.generic]) -> bool:
    """Whether an array of few rows and many columns has the coordinates in its rows."""
    return array.ndim == 2 and array.shape[0] in (3, 4, 6) and array.shape[1] > _MAX_PARTS


def _floats(array: NDArray[np.generic]) -> NDArray[np.floating]:
    if array.ndim == 0 or array.dtype.kind not in "fiu":
        raise MalformedFileError(f"values of type {array.dtype}; expected real numbers")
    small = array.dtype.kind == "f" and array.dtype.itemsize <= 4
    return np.ascontiguousarray(array, np.float32 if small else np.float64)


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
