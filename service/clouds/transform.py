"""Decoded clouds moved by a rigid transform, and merged, with their attributes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from service.formats import DecodedCloud
from service.formats.column_names import find_normals

MAX_FLOAT32_ROUNDING = 1e-6
"""Rounding by float32, as a share of the cloud's extent, up to which float32 points stay so."""


def transform_cloud(cloud: DecodedCloud, T: NDArray[np.float64]) -> DecodedCloud:
    """Move a cloud: its points, and its normals where it has them.

    Parameters
    ----------
    T : (4, 4)
        Rigid transform.

    Returns
    -------
    DecodedCloud
        The points become float64 unless they were float32 and still fit into it.
    """
    points = cloud.points.astype(np.float64) @ T[:3, :3].T + T[:3, 3]
    if cloud.points.dtype == np.float32 and _fits_float32(points):
        points = points.astype(np.float32)
    return replace(cloud, points=points, attributes=_rotate_normals(_attributes(cloud), T[:3, :3]))


def merge_clouds(source: DecodedCloud, target: DecodedCloud) -> DecodedCloud:
    """Append the target to the source.

    Returns
    -------
    DecodedCloud
        With the attributes that both have in the same type, and "cloud": 0 for the points of the
        source, 1 for those of the target.
    """
    first, second = _attributes(source), _attributes(target)
    common = [name for name in first if name in second and first[name].dtype == second[name].dtype]
    attributes = {name: np.concatenate([first[name], second[name]]) for name in common}
    sizes = [len(source.points), len(target.points)]
    attributes["cloud"] = np.repeat(np.array([0, 1], np.uint8), sizes)
    points = np.concatenate([source.points, target.points])
    return replace(source, points=points, attributes=attributes)


def _attributes(cloud: DecodedCloud) -> dict[str, NDArray[np.generic]]:
    """Return a new dictionary of the attributes; of the normals where there is nothing else."""
    if cloud.attributes or cloud.normals is None:
        return dict(cloud.attributes)
    return dict(zip(("nx", "ny", "nz"), cloud.normals.T, strict=True))


def _rotate_normals(
    attributes: dict[str, NDArray[np.generic]], R: NDArray[np.float64]
) -> dict[str, NDArray[np.generic]]:
    names = list(attributes)
    columns = find_normals(names)
    if columns is None:
        return attributes
    normal_names = [names[column] for column in columns]
    rotated = np.stack([attributes[name] for name in normal_names], axis=1) @ R.T
    return attributes | {
        name: values.astype(attributes[name].dtype)
        for name, values in zip(normal_names, rotated.T, strict=True)
    }


def _fits_float32(points: NDArray[np.float64]) -> bool:
    """Return whether float32 rounds the finite points by little, compared to their extent."""
    finite = points[np.isfinite(points).all(axis=1)]
    if len(finite) == 0:
        return True
    largest = np.float32(np.abs(finite).max())
    return bool(np.spacing(largest) <= MAX_FLOAT32_ROUNDING * np.ptp(finite, axis=0).max())
