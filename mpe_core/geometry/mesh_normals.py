"""Normals of the faces, edges and corners of a mesh, which tell outside from inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_MAX_TURNED_SHARE = 0.01
"""Share of the edges at which two faces may disagree about their sides; scans have some."""

_BLOCK_FACES = 1 << 16
"""Faces whose angles are computed at once, to bound the memory."""


@dataclass(frozen=True, slots=True)
class MeshNormals:
    """Angle-weighted normals (Baerentzen and Aanaes 2005), of any length.

    A point is outside of a closed mesh where it lies on the side of the normal at its nearest
    point, also where this is on an edge or a corner.
    """

    faces: Array
    """(F, 3)."""
    edges: Array
    """(E, 3) sums of the normals of the faces at an edge."""
    corners: Array
    """(V, 3) sums weighted by the angles of the faces at a corner."""
    face_edges: NDArray[np.int64]
    """(F, 3) rows of `edges`, from corner 0, 1, 2 to the next."""
    face_corners: NDArray[np.int64]
    """(F, 3) rows of `corners`; corners at one place are one."""
    are_consistent: bool
    """Whether the faces agree about which side is outside."""

    @classmethod
    def of(cls, points: Array, faces: NDArray[np.int64]) -> MeshNormals:
        """Compute the normals of triangles (F, 3) that have an area, at points (V, 3)."""
        face_corners = _merge_equal(points)[faces]
        ends = np.roll(face_corners, -1, axis=1)
        low, high = np.minimum(face_corners, ends), np.maximum(face_corners, ends)
        _, edges = np.unique(low * len(points) + high, return_inverse=True)
        face_edges = edges.reshape(-1, 3)
        normals = np.empty((len(faces), 3))
        at_edges = np.zeros((int(face_edges.max()) + 1, 3))
        at_corners = np.zeros((len(points), 3))
        for start in range(0, len(faces), _BLOCK_FACES):
            rows = slice(start, start + _BLOCK_FACES)
            normals[rows], angles = _normals_and_angles(points[faces[rows]])
            for k in range(3):
                np.add.at(at_edges, face_edges[rows, k], normals[rows])
                weighted = normals[rows] * angles[:, k : k + 1]
                np.add.at(at_corners, face_corners[rows, k], weighted)
        is_consistent = _agree(face_edges, face_corners < ends)
        return cls(normals, at_edges, at_corners, face_edges, face_corners, is_consistent)

    def at(self, rows: NDArray[np.int64], places: NDArray[np.int64]) -> Array:
        """Return the normals (N, 3) at places in faces, as `TriangleTree.nearest` gives them."""
        normals = self.faces[rows]
        on_edge, at_corner = (places > 0) & (places < 4), places > 3
        normals[on_edge] = self.edges[self.face_edges[rows[on_edge], places[on_edge] - 1]]
        normals[at_corner] = self.corners[self.face_corners[rows[at_corner], places[at_corner] - 4]]
        return normals


def _unit(vectors: Array) -> Array:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit: Array = vectors / np.maximum(lengths, 1e-300)
    return unit


def _normals_and_angles(triangles: Array) -> tuple[Array, Array]:
    """Return the unit normals (F, 3) and the angles (F, 3) of triangles (F, 3, 3)."""
    directions = _unit(np.roll(triangles, -1, axis=1) - triangles)
    normals = _unit(np.cross(directions[:, 0], directions[:, 1]))
    cosines = -np.einsum("fki,fki->fk", directions, np.roll(directions, 1, axis=1))
    return normals, np.arccos(np.clip(cosines, -1, 1))


def _merge_equal(points: Array) -> NDArray[np.int64]:
    """Return one number (V,) for all points at one place."""
    order = np.lexsort(points.T)
    is_new = np.ones(len(points), np.bool_)
    is_new[1:] = (np.diff(points[order], axis=0) != 0).any(axis=1)
    numbers = np.empty(len(points), np.int64)
    numbers[order] = np.cumsum(is_new) - 1
    return numbers


def _agree(face_edges: NDArray[np.int64], is_upwards: NDArray[np.bool_]) -> bool:
    """Whether two faces run along their common edge in opposite directions, at nearly all edges."""
    counts = np.bincount(face_edges.ravel())
    upwards = np.bincount(face_edges.ravel(), is_upwards.ravel())
    shared = counts == 2
    return bool((upwards[shared] != 1).sum() <= _MAX_TURNED_SHARE * max(1, shared.sum()))
