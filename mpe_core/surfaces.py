"""The surface of a target: of the points that sample it, or of the triangles of its mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpe_core.errors import CloudShapeError
from mpe_core.geometry.mesh_normals import MeshNormals
from mpe_core.geometry.nearest import NearestNeighbors
from mpe_core.geometry.triangle_tree import TriangleTree
from mpe_core.geometry.viewpoints import as_viewpoints, nearest_viewpoint

PLANE_POINTS = 12
"""Points of the target that a plane is fitted to: enough to average noise, few enough for edges."""
MAX_PLANE_VARIATION = 0.1
"""Smallest eigenvalue over the trace above which neighbours are no surface (leaves, noise)."""
MIN_PLANE_WIDTH = 0.02
"""Middle over largest eigenvalue below which neighbours lie on a line (one beam of a scanner)."""
_BATCH = 200_000
"""Queries of which the neighbourhoods are held at once."""


class TargetSurface:
    """The surface that the points of a target sample: a plane around each of them.

    Parameters
    ----------
    points
        (M, 3) the target; rows that are not finite are left out.
    normals
        (M, 3) normals that point out of the surface, of any length; None: unknown.
    viewpoint
        Place (3,) of the scanner, which saw the outside, or places (k, 3) of several, of which the
        nearest counts; where there are no normals.
    """

    def __init__(
        self,
        points: ArrayLike,
        normals: ArrayLike | None = None,
        viewpoint: ArrayLike | None = None,
    ) -> None:
        cloud = np.asarray(points, np.float64)
        rows = np.isfinite(cloud).all(axis=1)
        self._points = cloud[rows]
        self._tree = NearestNeighbors(self._points)
        self._normals = None if normals is None else np.asarray(normals, np.float64)[rows]
        self._viewpoints = None if viewpoint is None else as_viewpoints(viewpoint)
        self.is_signed = normals is not None or viewpoint is not None

    def measure(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the (N,) distances of points (N, 3) in the frame of the target.

        The distance is that from the plane through the nearest target points. It is never more
        than that from the nearest point itself, which counts beyond the edge of the surface and
        where the neighbours are no surface.
        """
        distances = np.full(len(points), np.nan)
        finite = np.flatnonzero(np.isfinite(points).all(axis=1))
        if len(self._points) == 0:
            return distances
        for start in range(0, len(finite), _BATCH):
            rows = finite[start : start + _BATCH]
            distances[rows] = self._measure_batch(points[rows].astype(np.float64))
        return distances

    def _measure_batch(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        straight, nearest = self._tree.nearest(points)
        places, where = np.unique(nearest, return_inverse=True)
        centers, normals, limits = (values[where] for values in self._fit_planes(places))
        offset = points - centers
        height = np.einsum("ni,ni->n", offset, normals)
        aside = points - self._points[nearest] - height[:, None] * normals
        has_plane = np.einsum("ni,ni->n", aside, aside) <= limits
        size = np.where(has_plane, np.minimum(np.abs(height), straight), straight)
        return np.where(height < 0, -size, size) if self.is_signed else size

    def _fit_planes(
        self, places: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Fit planes around rows of the target.

        Returns
        -------
        (K, 3) points of the planes.
        (K, 3) unit normals, to the outside where it is known.
        (K,) squared radii of the neighbourhoods; -1 where they are no surface.
        """
        middle = self._points[places]
        reach, rows = self._tree.nearest_of(middle, min(PLANE_POINTS, len(self._points)))
        around = self._points[rows]
        centers = around.mean(axis=1)
        spread = around - centers[:, None]
        eigenvalues, axes = np.linalg.eigh(np.einsum("kni,knj->kij", spread, spread))
        normals = self._orient(axes[:, :, 0], middle, places)
        low, mid, high = eigenvalues.T
        is_surface = (low <= MAX_PLANE_VARIATION * (low + mid + high)) & (
            mid > MIN_PLANE_WIDTH * high
        )
        return centers, normals, np.where(is_surface, reach[:, -1] ** 2, -1.0)

    def _orient(
        self, axes: NDArray[np.float64], middle: NDArray[np.float64], places: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        if self._normals is not None:
            outside = self._normals[places]
        elif self._viewpoints is not None:
            outside = self._viewpoints[nearest_viewpoint(middle, self._viewpoints)] - middle
        else:
            return axes
        is_inward = np.einsum("ni,ni->n", axes, outside) < 0
        turned: NDArray[np.float64] = np.where(is_inward[:, None], -axes, axes)
        return turned


class MeshSurface:
    """The triangles of a mesh.

    Distances have a sign where the faces agree about their sides: positive on the side from which
    their corners run counter-clockwise.

    Parameters
    ----------
    points
        (V, 3) corners; faces at those that are not finite are left out.
    faces
        (F, 3) rows of the corners; faces without area are left out.

    Raises
    ------
    CloudShapeError
        The arrays have other shapes, a row does not exist, or no face has an area.
    """

    def __init__(self, points: ArrayLike, faces: ArrayLike) -> None:
        corners, rows = np.asarray(points, np.float64), np.asarray(faces, np.int64)
        rows = _keep_faces_with_area(corners, rows)
        used, places = np.unique(rows, return_inverse=True)
        self._origin = corners[used].mean(axis=0)
        local = corners[used] - self._origin
        triangles = places.reshape(-1, 3)
        self._tree = TriangleTree(local[triangles])
        self._normals = MeshNormals.of(local, triangles)
        self.is_signed = self._normals.are_consistent

    def measure(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the (N,) distances of points (N, 3) from the nearest point of the triangles."""
        distances = np.full(len(points), np.nan)
        finite = np.flatnonzero(np.isfinite(points).all(axis=1))
        for start in range(0, len(finite), _BATCH):
            rows = finite[start : start + _BATCH]
            distances[rows] = self._measure_batch(points[rows] - self._origin)
        return distances

    def _measure_batch(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        nearest, rows, places = self._tree.nearest(points)
        offsets = points - nearest
        size: NDArray[np.float64] = np.linalg.norm(offsets, axis=1)
        if not self.is_signed:
            return size
        heights = np.einsum("ni,ni->n", offsets, self._normals.at(rows, places))
        return np.where(heights < 0, -size, size)


def _keep_faces_with_area(
    corners: NDArray[np.float64], faces: NDArray[np.int64]
) -> NDArray[np.int64]:
    if corners.ndim != 2 or corners.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise CloudShapeError(
            f"points of shape {corners.shape} and faces of shape {faces.shape}; expected (V, 3) "
            "and (F, 3)"
        )
    if len(faces) and (faces.min() < 0 or faces.max() >= len(corners)):
        raise CloudShapeError(f"a face has a corner that is none of the {len(corners)} points")
    first, second, third = (corners[places] for places in faces.T)
    with np.errstate(over="ignore", invalid="ignore"):
        areas = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    kept: NDArray[np.int64] = faces[np.isfinite(areas) & (areas > 0)]
    if len(kept) == 0:
        raise CloudShapeError(f"none of the {len(faces)} faces has an area: measure the points")
    return kept
