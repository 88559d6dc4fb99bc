"""Clouds of arrays with names, as files of several arrays hold them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from service.formats.array_cloud import (
    Array,
    all_fields,
    array_columns,
    extra_fields,
    to_cloud,
    with_attribute,
)
from service.formats.column_names import find_xyz
from service.formats.column_words import NORMAL_NAMES, POINT_NAMES
from service.formats.decoded_cloud import DecodedCloud
from service.formats.errors import (
    MalformedFileError,
    UnsupportedFileError,
)

_MAX_ARRAYS = 64
"""Arrays beside the points that are kept."""
_MAX_LISTED = 20
"""Names that a message lists."""


def cloud_of_arrays(
    arrays: Mapping[str, Callable[[], Array]],
    format: str,
    weights: str | None = None,
    wanted: str | None = None,
    *,
    attributes: bool = False,
    column_names: list[str] | None = None,
) -> DecodedCloud:
    """Make a cloud of the array called points, xyz, ..., or the only one, and of its normals.

    Parameters
    ----------
    arrays
        What reads each array, by its name; parts of a name before a slash or point are its folder.
    format
        Name of the format.
    weights
        Array, or field of the array of points, to keep as an attribute.
    wanted
        Name of the array of points; None: by the usual names.
    attributes
        Keep all arrays with one number or a few for each point.
    column_names
        As `names` of `name_columns`.

    Raises
    ------
    CloudFileError
        The arrays have other names, shapes or types.
    """
    if wanted is None and (axes := find_axis_arrays(arrays)) is not None:
        arrays = _join_axes(arrays, axes)
    name = choose_array(arrays, wanted)
    array = arrays[name]()
    cloud = to_cloud(array, format)
    count = len(cloud.points)
    others = _short_names(set(arrays) - {name}, name)
    normals, normals_name = cloud.normals, _find_normals(others)
    if normals_name is not None:
        normals = to_cloud(arrays[normals_name](), format).points
    if normals is not None and len(normals) != count:
        raise MalformedFileError(
            f"there are {len(normals)} normals for {count} points; expected one for each"
        )
    others.pop(normals_name or "", None)
    others |= {weights: weights} if weights is not None and weights in others else {}
    known = extra_fields(array) | dict.fromkeys(sorted(others))
    if weights is not None and weights in arrays:
        known[weights] = _flat(arrays[weights]())
    kept = all_fields(array, count, column_names) if attributes else {}
    used = {name, normals_name, weights}
    for other in sorted(others)[: _MAX_ARRAYS if attributes else 0]:
        try:
            columns = array_columns(others[other], _flat(arrays[other]()), count)
        except UnsupportedFileError:  # of pickled objects
            columns = {}
        kept |= columns
        used |= {other} if columns else set()
    ignored = len(set(arrays) - used)
    warnings = () if attributes else cloud.warnings
    warnings += (f"{ignored} arrays beside {name!r} are ignored",) if ignored else ()
    cloud = DecodedCloud(cloud.points, format, warnings, normals, attributes=kept)
    return cloud if weights is None else with_attribute(cloud, weights, known)


def _short_names(names: set[str], points: str) -> dict[str, str]:
    """Return other arrays with their names, without the folder of the points if they are in it."""
    folder = points.removesuffix(_last_part(points))
    short = {name: name.removeprefix(folder) for name in names}
    return {name: name if bare in names else bare for name, bare in short.items()}


def _find_normals(names: Mapping[str, str]) -> str | None:
    """Return the array in the folder of the points that is called normals, Normal, ..."""
    found = [name for name, bare in names.items() if bare.lower() in NORMAL_NAMES]
    return found[0] if len(found) == 1 else None


def find_axis_arrays(names: Iterable[str]) -> tuple[str, ...] | None:
    """Return the arrays x, y and z, where no array is that of the points."""
    names = list(names)
    bare = [_last_part(name) for name in names]
    if set(bare) & {*POINT_NAMES} or (places := find_xyz(bare)) is None:
        return None
    return tuple(names[place] for place in places)


def _join_axes(
    arrays: Mapping[str, Callable[[], Array]], axes: tuple[str, ...]
) -> dict[str, Callable[[], Array]]:
    """Put an array of points in the place of those of its axes."""

    def join() -> Array:
        columns = [_flat(arrays[name]()) for name in axes]
        if any(column.ndim != 1 or column.shape != columns[0].shape for column in columns):
            shapes = ", ".join(f"{name[:40]!r} {arrays[name]().shape}" for name in axes)
            raise MalformedFileError(f"the coordinates have the shapes {shapes}; expected equal")
        return np.stack(columns, axis=1)

    others = {name: read for name, read in arrays.items() if name not in axes}
    return {POINT_NAMES[0]: join} | others


def choose_array(names: Iterable[str], wanted: str | None = None) -> str:
    """Choose the array of points by its name, which may be given, with its folder or without.

    Raises
    ------
    MalformedFileError
        No name, or several, are those of points; the message lists the names.
    """
    names = list(names)
    for name in (wanted,) if wanted is not None else POINT_NAMES:
        found = [item for item in names if _last_part(item) == _last_part(name)]
        if not found and wanted is None:
            found = [item for item in names if _last_part(item).lower() == name]
        if name in names or len(found) == 1:
            return name if name in names else found[0]
    if len(names) == 1 and wanted is None:
        return names[0]
    listed = ", ".join(repr(name[:60]) for name in names[:_MAX_LISTED])
    expected = f"one called {', '.join(POINT_NAMES)}; else name it by 'array'"
    if wanted is not None:
        expected = f"one called {wanted[:60]!r}, as 'array' says"
    raise MalformedFileError(
        f"the file has {len(names)} arrays ({listed}); expected only one, or {expected}"
    )


def _last_part(name: str) -> str:
    return name.replace(".", "/").rpartition("/")[2]


def _flat(array: Array) -> Array:
    """Return an array of one row or column as a list of numbers."""
    is_line = array.ndim == 2 and 1 in array.shape
    return array.reshape(-1) if is_line else array
