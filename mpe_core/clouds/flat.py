"""Flat clouds, as outlines, plates and scans of one height: raised to walls, and laid back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mpe_core.geometry.bounds import measure_extent, scatter_matrix
from mpe_core.geometry.rigid import apply, pose
from mpe_core.geometry.sampling import take_every
from mpe_core.kernels.bounds import bounding_box

Array = NDArray[np.float64]

MAX_THICKNESS = 1e-5
"""Thickness of a flat cloud over its length: what files round. Scans of walls are rougher."""

TELLING_POINTS = 100
"""Points, or up to twice as many, that tell that a cloud is not flat."""

MAX_OUTLINE_POINTS = 4000
"""Points of an outline that are raised, or up to twice as many."""

LAYERS, WALL_HEIGHT = 24, 0.25
"""Layers of a wall, and its height above the plane over the radius of the outline."""

MIN_OUTLINE_POINTS = 20
"""Points of an outline; with fewer all points are raised."""

CURVE_SHARE = 0.5
"""Share of the points on the outline from which on a cloud is a curve, not a plate."""

CURVE_ERROR, RIM_ERROR = 0.75, 4.0
"""Distance from the outline in spacings: between two points of a curve it is half a spacing, and
the rim of a plate of random points is ragged; the nearest of them are much nearer than the mean."""

OUTLINE_GAP = 0.8 * np.pi
"""Angle without a neighbour from which on a point lies on an outline: of 24 random neighbours, one
in a thousand has so much."""

OUTLINE_NEIGHBOURS = 24
"""Neighbours that the gap is looked for between."""


@dataclass(frozen=True, slots=True)
class Plane:
    """Plane of a flat cloud."""

    T: Array
    """(4, 4) pose that lays the plane on z = 0, with the cloud's mean in the origin."""
    is_level: bool
    """Whether all points have the same z: the cloud is one of two dimensions."""


def find_plane(points: Array) -> Plane | None:
    """Find the plane of points (N, 3); None if they are not flat."""
    if not _may_be_flat(points):
        return None
    extent = measure_extent(points)
    if np.ptp(points[:, 2]) == 0:
        return Plane(pose(np.eye(3), -extent.mean), is_level=True)
    spread, axes = np.linalg.eigh(scatter_matrix(points, extent))
    if spread[0] > len(points) * MAX_THICKNESS**2:
        return None
    offsets = np.einsum("ni,i->n", points - extent.mean, axes[:, 0])
    if np.abs(offsets).max() > MAX_THICKNESS * extent.max_offset:
        return None
    R = np.array([axes[:, 2], axes[:, 1], np.cross(axes[:, 2], axes[:, 1])])
    return Plane(pose(R, -R @ extent.mean), is_level=False)


def _may_be_flat(points: Array) -> bool:
    """Tell quickly, from a few of the points (N, 3), whether all may lie in a plane."""
    few = take_every(points, TELLING_POINTS)
    offsets = few - few.mean(axis=0)
    variance = np.linalg.eigvalsh(np.einsum("ni,nj->ij", offsets, offsets) / len(few))[0]
    low, high = bounding_box(points)
    return bool(variance <= np.square(MAX_THICKNESS * (high - low)).sum())


@dataclass(frozen=True, slots=True)
class Outline:
    """Outline of a flat cloud, in the frame of its plane."""

    points: Array
    """(K, 3) points, with z = 0."""
    error: float
    """Distance of the points from the true outline that sampling explains."""

    def raise_walls(self) -> Array:
        """(K, 3) points above and below the outline: what fits the walls fits the outline."""
        outline = take_every(self.points, MAX_OUTLINE_POINTS)
        height = WALL_HEIGHT * np.linalg.norm(outline, axis=1).max()
        z = np.linspace(-height, height, LAYERS)
        return np.column_stack([np.repeat(outline[:, :2], LAYERS, 0), np.tile(z, len(outline))])


def draw_outline(points: Array, plane: Plane) -> Outline:
    """Outline of flat points (N, 3): all of a curve, the rim of a plate."""
    flat = apply(plane.T, points) * (1, 1, 0)
    outline = find_outline(flat[:, :2])
    distances, _ = cKDTree(flat).query(flat, 2)
    spacing = float(np.median(np.asarray(distances)[:, 1]))
    is_curve = len(outline) > CURVE_SHARE * len(points)
    error = (CURVE_ERROR if is_curve else RIM_ERROR) * spacing
    return Outline(np.column_stack([outline, np.zeros(len(outline))]), error)


def find_outline(points: Array) -> Array:
    """(K, 2) points of (N, 2) around which a wide angle is free of neighbours; all of a curve."""
    count = min(OUTLINE_NEIGHBOURS + 1, len(points))
    _, nearest = cKDTree(points).query(points, count)
    rays = points[np.asarray(nearest)[:, 1:]] - points[:, None]
    angles = np.sort(np.arctan2(rays[..., 1], rays[..., 0]), axis=1)
    gaps = np.diff(np.concatenate([angles, angles[:, :1] + 2 * np.pi], axis=1), axis=1)
    outline: Array = points[gaps.max(axis=1) > OUTLINE_GAP]
    return outline if len(outline) >= MIN_OUTLINE_POINTS else points


def lay_flat(T: Array) -> Array:
    """(4, 4) pose next to T that keeps the plane z = 0, either side up."""
    up = 1.0 if T[2, 2] >= 0 else -1.0
    turn = np.arctan2(T[1, 0] - up * T[0, 1], T[0, 0] + up * T[1, 1])
    c, s = np.cos(turn), np.sin(turn)
    return pose(np.array([[c, -up * s, 0], [s, up * c, 0], [0, 0, up]]), T[:3, 3] * (1, 1, 0))
