"""Relief of a cloud: bright points are raised over the surface, so that its pattern is a shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mpe_core.geometry.bounds import measure_extent, scatter_matrix
from mpe_core.geometry.cell_list import CellList, Points, voxel_downsample_weighted

Array = NDArray[np.float64]

HEIGHT = 0.15
"""Height of the brightest places over the darkest, in radii of the smaller cloud: above the cut-off
of the planes (0.007), below the reach that normals are fitted over."""

DARK, BRIGHT = 0.005, 0.995
"""Quantiles of the brightness that the height spans, whatever its unit: gain and offset of the
scanner do not matter. Markings of a road are one per cent of it."""

THINNING = 0.0075
"""Edge of the cubes in which brightness is averaged: half the usual edge of the search."""

NEIGHBOURS = 16
"""Places that the brightness is smoothed over, so that its noise is no relief."""

NORMAL_REACH = 0.065
"""Radius of the planes that the normals are taken from, as in the search."""

MAX_THINNESS = 0.2
"""Thickness over width up to which a cloud is a sheet, raised to one side as a whole."""

MIN_CONTRAST = 1e-6
"""Range of the brightness over its magnitude from which on there is a pattern."""


@dataclass(frozen=True, slots=True)
class Painted:
    """Thinned cloud with its brightness; lengths in radii of the smaller cloud."""

    points: Points
    """(K, 3) points."""
    height: Array
    """(K,) smoothed brightness in [-1, 1], 0 for the median."""
    axis: Array | None
    """(3,) axis across a sheet; None for other clouds."""

    def raise_relief(self, side: int) -> Array:
        """Return the points (K, 3), raised across the sheet to the side 1 or -1, or outwards."""
        points = self.points.astype(np.float64)
        return points + HEIGHT * self.height[:, None] * self._directions(points, side)

    def _directions(self, points: Array, side: int) -> Array:
        """(K, 3) unit vectors in which bright points are raised."""
        if self.axis is not None:
            return np.tile(side * self.axis, (len(points), 1))
        normals = CellList(self.points, NORMAL_REACH).planes(self.points).normals.astype(np.float64)
        outwards = np.sign(np.einsum("ni,ni->n", normals, points - points.mean(axis=0)))
        return np.asarray(outwards[:, None] * normals)


def find_pattern(points: Array, brightness: Array) -> Painted | None:
    """Thin a normalized cloud (N, 3), and smooth its brightness (N,); None where it is uniform."""
    known = np.isfinite(brightness)
    if known.sum() < NEIGHBOURS:
        return None
    points, brightness = points[known], brightness[known]
    dark, bright = np.quantile(brightness, (DARK, BRIGHT))
    if bright - dark <= MIN_CONTRAST * max(abs(dark), abs(bright)):
        return None
    scaled = np.clip((brightness - dark) / (bright - dark), 0, 1)
    thinned, means = voxel_downsample_weighted(points.astype(np.float32), 1 + scaled, THINNING)
    _, rows = cKDTree(thinned).query(thinned, min(NEIGHBOURS, len(thinned)))
    smooth = means.astype(np.float64)[np.asarray(rows).reshape(len(thinned), -1)].mean(axis=1)
    low, high = np.quantile(smooth, (DARK, BRIGHT))
    if high <= low:
        return None
    height = np.clip((smooth - np.median(smooth)) / (high - low), -1, 1)
    return Painted(thinned, height, _find_axis(thinned.astype(np.float64)))


def _find_axis(points: Array) -> Array | None:
    """Find the axis across the points; None unless they form a sheet."""
    spread, axes = np.linalg.eigh(scatter_matrix(points, measure_extent(points)))
    axis: Array = axes[:, 0]
    return axis if spread[0] <= MAX_THINNESS**2 * spread[1] else None
