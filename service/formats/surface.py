"""Clouds for a registration: their points, of meshes samples of the surface, and brightness."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.formats.brightness import find_brightness
from service.formats.decoded_cloud import DecodedCloud, ReadLimits
from service.formats.errors import CloudFileError, FileLimitError, MalformedFileError
from service.formats.read import read_points

MIN_DEFAULT_SAMPLES = 50_000
"""Samples of a mesh by default; one of more vertices gets as many samples as vertices."""
_MIN_SHARE_AT_FACES = 0.5
"""Share of the vertices at faces from which on the faces are the surface by default, and no
leftovers."""
_BLOCK_FACES = 1 << 20
"""Faces whose areas are computed at once, to bound the memory."""
_ABOUT_ATTRIBUTES = re.compile(r"^(?!the faces).*\bnot kept\b")
"""Warnings of readers about attributes that nobody asked for."""
_SEED = 0
"""Seed of the samples: the same file gives the same points."""


def read_surface(
    path: str | Path,
    limits: ReadLimits | None = None,
    *,
    surface_samples: int | None = None,
    **choices: Any,
) -> DecodedCloud:
    """Decode a cloud file as `read_points` does, with its brightness, and sample meshes.

    Parameters
    ----------
    path, limits, choices
        As for `read_points`.
    surface_samples
        Number of samples; None: as many as vertices, at least MIN_DEFAULT_SAMPLES. 0: the
        vertices of the file.

    Returns
    -------
    DecodedCloud
        The samples in the order of the faces, with their weights, and `mesh`; a warning tells
        their number. A file without faces is returned as it is.

    Raises
    ------
    CloudFileError
        The file cannot be read, or has no surface of which so many samples can be taken.
    """
    cloud = _read_with_brightness(path, limits, **choices)
    if surface_samples == 0:
        return cloud
    shares = _areas(cloud)
    if shares is not None and surface_samples is None and not _is_at_faces(cloud):
        return replace(cloud, warnings=(*cloud.warnings, _few_faces(cloud)))
    if shares is None:
        if surface_samples is not None:
            lost = "".join(f" ({text})" for text in cloud.warnings if text.startswith("the faces"))
            raise MalformedFileError(
                f"surface_samples is {surface_samples}, but the file, read as {cloud.format}, has "
                f"no faces with an area{lost}: leave surface_samples out, or set it to 0"
            )
        return cloud
    most = (limits or ReadLimits()).max_points
    count = surface_samples or min(max(MIN_DEFAULT_SAMPLES, len(cloud.points)), most)
    if count > most:
        raise FileLimitError(f"surface_samples is {count}; the limit is {most} points")
    return _sample(cloud, shares, count)


def _read_with_brightness(
    path: str | Path, limits: ReadLimits | None, *, attributes: bool = False, **choices: Any
) -> DecodedCloud:
    """Read points, faces, colour and intensity; the attributes are kept on request alone."""
    try:
        cloud = read_points(path, limits, **choices, attributes=True)
    except CloudFileError:  # perhaps in an attribute
        return read_points(path, limits, **choices, attributes=attributes, faces=True)
    cloud = replace(cloud, brightness=find_brightness(cloud.attributes))
    if attributes:
        return cloud
    warnings = tuple(text for text in cloud.warnings if not _ABOUT_ATTRIBUTES.search(text))
    return replace(cloud, attributes={}, las=None, warnings=warnings)


def _areas(cloud: DecodedCloud) -> NDArray[np.float64] | None:
    """Return the area (F,) of each face, 0 where it is not finite; None without a surface."""
    if cloud.faces is None:
        return None
    blocks = range(0, len(cloud.faces), _BLOCK_FACES)
    areas = np.concatenate(
        [
            np.linalg.norm(_normals(cloud.points, cloud.faces[i : i + _BLOCK_FACES]), axis=1)
            for i in blocks
        ]
    )
    areas[~np.isfinite(areas)] = 0.0
    return areas if 0 < areas.sum() < np.inf else None


def _is_at_faces(cloud: DecodedCloud) -> bool:
    """Whether enough of the vertices are at faces, so that these are the surface."""
    at_faces = np.zeros(len(cloud.points), np.bool_)
    at_faces[cloud.faces] = True
    return bool(at_faces.mean() >= _MIN_SHARE_AT_FACES)


def _few_faces(cloud: DecodedCloud) -> str:
    assert cloud.faces is not None  # noqa: S101
    return (
        f"the {len(cloud.faces)} triangles are at few of the {len(cloud.points)} points: the "
        "points count, and not the surface; surface_samples takes samples of it"
    )


def _normals(points: NDArray[np.floating], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the normal (F, 3) of each face, as long as twice its area."""
    with np.errstate(over="ignore", invalid="ignore"):
        first, second, third = (points[corners].astype(np.float64) for corners in faces.T)
        return np.cross(second - first, third - first)


def _sample(cloud: DecodedCloud, areas: NDArray[np.float64], count: int) -> DecodedCloud:
    """Take one sample from each of `count` stretches of equal area, at random within it."""
    assert cloud.faces is not None  # noqa: S101
    random = np.random.default_rng(_SEED)
    ends = np.cumsum(areas)
    places = (np.arange(count) + random.random(count)) / count * ends[-1]
    rows = np.minimum(np.searchsorted(ends, places, side="right"), np.flatnonzero(areas)[-1])
    root, second = np.sqrt(random.random(count)), random.random(count)
    shares = np.stack([1 - root, root * (1 - second), root * second], axis=1)
    corners = cloud.faces[rows]
    normals = _normals(cloud.points, corners)
    text = (
        f"{count} points are sampled on the {len(cloud.faces)} triangles, evenly by area, in place "
        f"of the {len(cloud.points)} vertices; inlier pairs number the samples. surface_samples "
        "sets their number, 0 takes the vertices"
    )
    return replace(
        cloud,
        points=_mix(cloud.points, corners, shares),
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
        attributes={},
        brightness={
            kind: _mix(values, corners, shares).astype(np.float32)
            for kind, values in cloud.brightness.items()
        },
        weights=None if cloud.weights is None else _mix(cloud.weights, corners, shares),
        faces=None,
        warnings=(*cloud.warnings, text),
        mesh=cloud,
    )


def _mix(
    values: NDArray[Any], corners: NDArray[np.int64], shares: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the mean of the values (V,) or (V, 3) at the corners (N, 3) with these shares."""
    mixed: NDArray[np.float64] = np.einsum("nk,nk...->n...", shares, values[corners].astype(float))
    return mixed
