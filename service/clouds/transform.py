"""Decoded clouds moved by a rigid transform, and merged, with their attributes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from service.clouds.quaternions import multiply, to_quaternion
from service.clouds.splats import rotate_splats
from service.formats import DecodedCloud, LasMetadata, LasRecord
from service.formats.column_names import find_normals, find_vectors

_MAX_NAMES = 20
"""Names of attributes that a warning lists."""
MAX_FLOAT32_ROUNDING = 1e-6
"""Rounding by float32, as a share of the cloud's extent, up to which float32 points stay so."""


def transform_cloud(cloud: DecodedCloud, T: NDArray[np.float64]) -> DecodedCloud:
    """Move a cloud, and turn what has a direction: normals, velocities, Gaussian splats.

    Parameters
    ----------
    T : (4, 4)
        Rigid transform, or a similarity; directions are turned, and not scaled.

    Returns
    -------
    DecodedCloud
        The points become float64 unless they were float32 and still fit into it.
    """
    scale = np.cbrt(np.linalg.det(T[:3, :3]))
    R = T[:3, :3] if abs(scale - 1) < 1e-9 else T[:3, :3] / scale
    points = cloud.points.astype(np.float64) @ T[:3, :3].T + T[:3, 3]
    if cloud.points.dtype == np.float32 and _fits_float32(points):
        points = points.astype(np.float32)
    attributes = list_attributes(cloud)
    attributes |= _rotate_vectors(attributes, R) | rotate_splats(attributes, R)
    viewpoints = tuple(_move_viewpoint(viewpoint, T) for viewpoint in cloud.viewpoints)
    return replace(cloud, points=points, attributes=attributes, viewpoints=viewpoints)


def merge_clouds(source: DecodedCloud, target: DecodedCloud) -> DecodedCloud:
    """Append the target to the source.

    Returns
    -------
    DecodedCloud
        With the attributes that both have in the same type, and "cloud": 0 for the points of the
        source, 1 for those of the target. A warning names the others.
    """
    first, second = list_attributes(source), list_attributes(target)
    common = [name for name in first if name in second and first[name].dtype == second[name].dtype]
    attributes = {name: np.concatenate([first[name], second[name]]) for name in common}
    sizes = [len(source.points), len(target.points)]
    attributes["cloud"] = np.repeat(np.array([0, 1], np.uint8), sizes)
    return replace(
        source,
        points=np.concatenate([source.points, target.points]),
        attributes=attributes,
        warnings=source.warnings + target.warnings + _warn_of_others(first, second, common),
        viewpoints=(),
        faces=_merge_faces(source, target),
        las=_merge_las(source.las, target.las),
    )


def adopt_crs(cloud: DecodedCloud, crs: tuple[LasRecord, ...]) -> DecodedCloud:
    """Give a moved cloud the coordinate system of its target; a warning says if it has none."""
    warnings = cloud.warnings
    if cloud.crs and not crs:
        warnings += (
            "the coordinate system of the source is left out: the points are in the target's "
            "frame, and its file names none",
        )
    return replace(cloud, crs=crs, warnings=warnings)


def list_attributes(cloud: DecodedCloud) -> dict[str, NDArray[np.generic]]:
    """Return a new dictionary of the attributes, with the normals under some name."""
    if cloud.normals is None or find_normals(list(cloud.attributes)) is not None:
        return dict(cloud.attributes)
    return dict(zip(("nx", "ny", "nz"), cloud.normals.T, strict=True)) | cloud.attributes


def _warn_of_others(
    first: Mapping[str, object], second: Mapping[str, object], common: Sequence[str]
) -> tuple[str, ...]:
    others = [name for name in dict.fromkeys([*first, *second]) if name not in common]
    if not others:
        return ()
    names = ", ".join(map(repr, others[:_MAX_NAMES])) + (", ..." * (len(others) > _MAX_NAMES))
    return (f"not kept, because both clouds do not have them in the same type: {names}",)


def _merge_faces(source: DecodedCloud, target: DecodedCloud) -> NDArray[np.int64] | None:
    if source.faces is None and target.faces is None:
        return None
    empty = np.empty((0, 3), np.int64)
    first, second = (empty if mesh.faces is None else mesh.faces for mesh in (source, target))
    return np.concatenate([first, second + len(source.points)])


def _merge_las(first: LasMetadata | None, second: LasMetadata | None) -> LasMetadata | None:
    """Return the source's encoding, with the finer scale of both."""
    if first is None:
        return None
    if second is None or first.scale is None or second.scale is None:
        return replace(first, scale=None)
    return replace(first, scale=min(first.scale, second.scale))


def _move_viewpoint(viewpoint: tuple[float, ...], T: NDArray[np.float64]) -> tuple[float, ...]:
    """Move the pose tx, ty, tz, qw, qx, qy, qz of the sensor."""
    place = T[:3, :3] @ viewpoint[:3] + T[:3, 3]
    quaternion = np.array(viewpoint[3:])
    turned = multiply(to_quaternion(T[:3, :3]), quaternion)
    return (*place.tolist(), *turned.tolist())


def _rotate_vectors(
    attributes: dict[str, NDArray[np.generic]], R: NDArray[np.float64]
) -> dict[str, NDArray[np.generic]]:
    names = list(attributes)
    turned: dict[str, NDArray[np.generic]] = {}
    for columns in find_vectors(names):
        parts = [names[column] for column in columns]
        if any(attributes[name].dtype.kind != "f" for name in parts):
            continue
        rotated = np.stack([attributes[name] for name in parts], axis=1) @ R.T
        for name, values in zip(parts, rotated.T, strict=True):
            turned[name] = values.astype(attributes[name].dtype)
    return turned


def _fits_float32(points: NDArray[np.float64]) -> bool:
    """Return whether float32 rounds the finite points by little, compared to their extent."""
    finite = points[np.isfinite(points).all(axis=1)]
    if len(finite) == 0:
        return True
    largest = np.float32(np.abs(finite).max())
    return bool(np.spacing(largest) <= MAX_FLOAT32_ROUNDING * np.ptp(finite, axis=0).max())
