"""Faces of meshes as triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import FileLimitError, MalformedFileError

LARGE_MESH_WARNING = "the faces are not kept, because the file is large: its vertices are taken"


def triangulate(corners: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cut polygons into fans of triangles; those of fewer than three corners are left out.

    Parameters
    ----------
    corners
        Indices of the corners of all faces, one face after the other.
    sizes
        Number of corners of each face.

    Returns
    -------
    NDArray[np.int64]
        (F, 3).
    """
    starts = np.cumsum(sizes) - sizes
    parts = [np.empty((0, 3), np.int64)]
    for size in np.unique(sizes[sizes > 2]):
        polygons = corners[starts[sizes == size][:, None] + np.arange(size)]
        second = np.arange(1, size - 1)
        first = np.repeat(polygons[:, :1], size - 2, axis=1)
        fans = np.stack([first, polygons[:, second], polygons[:, second + 1]], axis=2)
        parts.append(fans.reshape(-1, 3))
    return np.concatenate(parts)


def check_face_count(points: int, faces: int, limits: ReadLimits) -> None:
    """Refuse a mesh whose points and faces are together more than the limit of points.

    A face takes as much memory as a point until samples of it are taken (docs/tuning.md).

    Raises
    ------
    FileLimitError
        There are too many.
    """
    if points + faces > limits.max_points:
        raise FileLimitError(
            f"{points} vertices and {faces} faces; the limit for both together is "
            f"{limits.max_points}: give more memory, or reduce the mesh"
        )


def check_faces(faces: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Return the faces if each corner is one of `count` points.

    Raises
    ------
    MalformedFileError
        A corner is no point.
    """
    if len(faces) and (faces.min() < 0 or faces.max() >= count):
        raise MalformedFileError("a face refers to a vertex that does not exist")
    return faces
