"""A cloud of one array: rows of coordinates, a scan in rows and columns, or records."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB
from service.formats.column_names import find_normals, find_xyz
from service.formats.column_words import POINT_NAMES
from service.formats.decoded_cloud import DecodedCloud
from service.formats.errors import (
    MalformedFileError,
    MissingAttributeError,
    UnsupportedFileError,
    missing_attribute,
)
from service.formats.unnamed_columns import name_columns

Array = NDArray[np.generic]
_COLOR_ARRAYS = ("color", "colors", "colour", "colours", "rgb")
_MAX_PARTS = 64
"""Numbers of an array for each point that are kept."""
_MAX_COLUMNS = 9
"""Columns of three to six rows from which on the rows are the coordinates."""
_MIN_PIXELS, _MAX_PIXEL_RATIO = 16, 32
"""Columns of a picture, and its rows for each: a cloud has more points than numbers a point."""


def extra_fields(array: NDArray[np.generic]) -> dict[str, NDArray[np.generic] | None]:
    """Return the fields of a structured array beside the coordinates."""
    names = array.dtype.names or ()
    places: set[str | None] = {names[place] for place in find_xyz(names) or ()}
    places = places or {_find_vector(array.dtype)}
    records = cast("NDArray[np.void]", array)
    return {name: records[name] for name in names if name not in places}


def _find_vector(dtype: np.dtype[Any]) -> str | None:
    """Return the field of three numbers that is called points, xyz, position, ...; else None."""
    shapes = {name: dtype[name].shape for name in dtype.names or ()}
    return next((name for name in POINT_NAMES if shapes.get(name) == (3,)), None)


def with_attribute(
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


def all_fields(
    array: NDArray[np.generic], count: int, column_names: list[str] | None = None
) -> dict[str, NDArray[np.generic]]:
    """Return the fields, or the columns after the third, that hold one number for each point.

    `column_names` is as `names` of `name_columns`.
    """
    if array.dtype.names:
        fields: dict[str, NDArray[np.generic]] = {}
        for name, column in extra_fields(array).items():
            if column is not None:
                fields |= array_columns(name, column, count)
        return fields
    if array.ndim != 2 or array.dtype.kind not in "fiu":
        return {}
    table = array.T if is_transposed(array.shape) else array
    return name_columns(table[:, 3:], range(4, table.shape[1] + 1), column_names)


def array_columns(
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


def to_cloud(array: NDArray[np.generic], format: str) -> DecodedCloud:
    """Make a cloud of an (N, 3 or more) or (H, W, 3) array, or one with the fields x, y, z."""
    if array.dtype.names:
        names = array.dtype.names
        vector = _find_vector(array.dtype)
        if vector is not None and find_xyz(names) is None:
            points = cast("NDArray[np.void]", array.reshape(-1))[vector]
            return DecodedCloud(_floats(points), format)
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
    _refuse_picture(array)
    if array.ndim == 3 and array.shape[2] == 3:
        return DecodedCloud(_floats(array.reshape(-1, 3)), format, _warn_of_image(array.shape))
    if array.ndim != 2 or array.shape[1] < 3:
        raise MalformedFileError(f"an array of shape {array.shape}; expected (N, 3) or (H, W, 3)")
    if is_transposed(array.shape):
        return DecodedCloud(
            _floats(array[:3].T), format, (f"the shape {array.shape} is read as its transpose",)
        )
    _refuse_matrix(array)
    extra = array.shape[1] - 3
    warnings = (f"{extra} columns after x, y, z are ignored",) if extra else ()
    return DecodedCloud(_floats(array[:, :3]), format, warnings)


def is_transposed(shape: tuple[int, ...]) -> bool:
    """Whether an array of few rows and many columns has the coordinates in its rows."""
    return len(shape) == 2 and shape[0] in (3, 4, 6) and shape[1] > _MAX_COLUMNS


def _warn_of_image(shape: tuple[int, ...]) -> tuple[str, ...]:
    """Say that an array is read as one scan in rows and columns, and not as several clouds."""
    rows, columns = shape[:2]
    if 1 in (rows, columns):
        return ()
    return (
        f"the shape {shape} is read as one scan of {rows} rows and {columns} columns; if it holds "
        "several clouds, save one of them",
    )


def _refuse_picture(array: Array) -> None:
    """Refuse depths or colours of the pixels of a picture.

    Raises
    ------
    UnsupportedFileError
        The array has about as many columns as rows, or three bytes for each row and column.
    """
    is_depth = (
        array.ndim == 2
        and array.shape[1] >= _MIN_PIXELS
        and _MIN_PIXELS <= array.shape[0] <= _MAX_PIXEL_RATIO * array.shape[1]
    )
    if is_depth or (array.ndim == 3 and array.shape[2] in (3, 4) and array.dtype == np.uint8):
        raise UnsupportedFileError(
            f"an array of shape {array.shape}, as the pixels of a picture; expected (N, 3) or "
            "(H, W, 3): turn each pixel's depth into a point by the camera's intrinsics"
        )


def _refuse_matrix(array: Array) -> None:
    """Refuse a transformation matrix.

    Raises
    ------
    UnsupportedFileError
        The first three rows and columns are a rotation, and the last row is 0, 0, 0, 1.
    """
    if array.shape != (4, 4) or array.dtype.kind not in "fiu":
        return
    matrix = array.astype(np.float64)
    is_rotation = np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), rtol=0, atol=1e-3)
    if is_rotation and (matrix[3] == (0, 0, 0, 1)).all():
        raise UnsupportedFileError(
            "the array is a transformation matrix, not points; send a cloud of points"
        )


def _floats(array: NDArray[np.generic]) -> NDArray[np.floating]:
    if array.ndim == 0 or array.dtype.kind not in "fiu":
        raise MalformedFileError(f"values of type {array.dtype}; expected real numbers")
    small = array.dtype.kind == "f" and array.dtype.itemsize <= 4
    return np.ascontiguousarray(array, np.float32 if small else np.float64)
