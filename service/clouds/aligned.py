"""Aligned files: the source of a registration moved into the frame of its target, and written."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.clouds.transform import adopt_crs, list_attributes, merge_clouds, transform_cloud
from service.formats import DecodedCloud, LasRecord, write_cloud, write_pieces

Read = Callable[[], Iterator[DecodedCloud]]
"""Returns the pieces of a cloud with their attributes: one, unless it is large."""
Measure = Callable[[NDArray[np.floating]], NDArray[np.float64]]
"""Returns the (N,) distances of moved points (N, 3) from the target's surface."""
DISTANCE_NAMES = {"ply": "scalar_distance"}
"""Name of the attribute with the distances, by format, where it is not "distance": CloudCompare
writes `scalar_` before the names of scalar fields in PLY files, and takes it off again."""


def write_aligned(
    path: Path,
    format: str,
    T: NDArray[np.float64],
    crs: tuple[LasRecord, ...],
    source: Read,
    target: Read | None = None,
    measure: Measure | None = None,
) -> tuple[str, ...]:
    """Write the moved source, whole, or in pieces where the memory does not hold it.

    Parameters
    ----------
    path
        File to write.
    format
        A key of service.formats.WRITERS.
    T : (4, 4)
        Pose of the source in the target's frame.
    crs
        Coordinate system of the target.
    source
        Reads the source.
    target
        Reads the target, if it is to be appended.
    measure
        Measures the distances that are added as an attribute; those of an appended target are NaN.

    Returns
    -------
    tuple[str, ...]
        Warnings of reading and writing.

    Raises
    ------
    CloudFileError
        A file cannot be read with its attributes, or not be written in this format.
    """
    clouds = [_read_whole(read) for read in (source, target) if read is not None]
    if any(cloud is None for cloud in clouds):
        return write_pieces(
            path, format, lambda: _iter_aligned(T, crs, source, target, measure, format)
        )
    first, *others = (cloud for cloud in clouds if cloud is not None)
    cloud = _add_distances(transform_cloud(first, T), measure, format)
    for other in others:
        cloud = merge_clouds(cloud, _add_distances(other, measure and _no_distances, format))
    cloud = adopt_crs(cloud, crs)
    return cloud.warnings + write_cloud(path, format, cloud)


def _read_whole(read: Read) -> DecodedCloud | None:
    """Return a cloud of one piece, None where there are more."""
    pieces = read()
    first = next(pieces)
    return first if next(pieces, None) is None else None


def _iter_aligned(
    T: NDArray[np.float64],
    crs: tuple[LasRecord, ...],
    source: Read,
    target: Read | None,
    measure: Measure | None,
    format: str,
) -> Iterator[DecodedCloud]:
    """Yield the moved pieces of the source, and those of the target."""
    names = None if target is None else _common_names(source, target)
    if names is not None and measure is not None:
        names.append(distance_name(format))
    for piece in source():
        moved = _add_distances(adopt_crs(transform_cloud(piece, T), crs), measure, format)
        yield moved if names is None else _number(moved, 0, names)
    if target is None or names is None:
        return
    for piece in target():
        cloud = replace(piece, attributes=list_attributes(piece), crs=crs)
        yield _number(_add_distances(cloud, measure and _no_distances, format), 1, names)


def distance_name(format: str) -> str:
    """Return the name of the attribute with the distances in a file of this format."""
    return DISTANCE_NAMES.get(format, "distance")


def _add_distances(cloud: DecodedCloud, measure: Measure | None, format: str) -> DecodedCloud:
    """Add the distances of the points, if they are wanted."""
    if measure is None:
        return cloud
    name, attributes = distance_name(format), list_attributes(cloud)
    warnings = cloud.warnings
    if name in attributes:
        warnings += (f"{name!r} of the file is replaced by the distances from the target",)
    attributes[name] = measure(cloud.points).astype(np.float32)
    return replace(cloud, attributes=attributes, warnings=warnings)


def _no_distances(points: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.full(len(points), np.nan)


def _common_names(source: Read, target: Read) -> list[str]:
    """Return the attributes that both clouds have in the same type."""
    first, second = (list_attributes(next(read())) for read in (source, target))
    return [name for name in first if name in second and first[name].dtype == second[name].dtype]


def _number(piece: DecodedCloud, cloud: int, names: list[str]) -> DecodedCloud:
    """Keep the attributes of these names, and add the attribute "cloud"."""
    attributes = {name: piece.attributes[name] for name in names if name in piece.attributes}
    lost = [name for name in piece.attributes if name not in names]
    warnings = piece.warnings
    if lost:
        listed = ", ".join(map(repr, lost[:20]))
        warnings += (f"not kept, because both clouds do not have them in the same type: {listed}",)
    attributes["cloud"] = np.full(len(piece.points), cloud, np.uint8)
    return replace(piece, attributes=attributes, warnings=warnings, viewpoints=(), faces=None)
