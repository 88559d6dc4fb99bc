"""A decoded cloud after a transform, its attributes kept and its normals turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from service.formats import DecodedCloud
from service.formats.column_names import find_normals

FINE = 1e-6
"""Share of the extent by which float32 may round; else the points become float64."""


def moved(cloud: DecodedCloud, T: NDArray[np.float64]) -> DecodedCloud:
    """The cloud after the rigid transform T (4, 4); in float32 if it was and still can be."""
    attributes = _attributes(cloud)
    names = list(attributes)
    normals = find_normals(names)
    if normals is not None:
        turned = np.stack([attributes[names[i]] for i in normals], axis=1) @ T[:3, :3].T
        for column, place in enumerate(normals):
            kind = attributes[names[place]].dtype
            attributes[names[place]] = turned[:, column].astype(kind)
    points = cloud.points.astype(np.float64) @ T[:3, :3].T + T[:3, 3]
    exact = cloud.points.dtype.itemsize > 4 or not _fits_float32(points)
    return replace(
        cloud, points=points if exact else points.astype(np.float32), attributes=attributes
    )


def merged(source: DecodedCloud, target: DecodedCloud) -> DecodedCloud:
    """Source, then target, with the attributes that both have, and "cloud": 0 and 1."""
    ours, theirs = _attributes(source), _attributes(target)
    common = [n for n, c in ours.items() if n in theirs and theirs[n].dtype == c.dtype]
    attributes = {name: np.concatenate([ours[name], theirs[name]]) for name in common}
    sizes = [len(source.points), len(target.points)]
    attributes["cloud"] = np.repeat(np.array([0, 1], np.uint8), sizes)
    points = np.concatenate([source.points, target.points])
    return replace(source, points=points, attributes=attributes)


def _attributes(cloud: DecodedCloud) -> dict[str, NDArray[np.generic]]:
    if cloud.attributes or cloud.normals is None:
        return dict(cloud.attributes)
    return dict(zip(("nx", "ny", "nz"), cloud.normals.T, strict=True))


def _fits_float32(points: NDArray[np.float64]) -> bool:
    finite = points[np.isfinite(points).all(axis=1)]
    if len(finite) == 0:
        return True
    largest = np.float32(np.abs(finite).max())
    return bool(np.spacing(largest) <= FINE * np.ptp(finite, axis=0).max())
