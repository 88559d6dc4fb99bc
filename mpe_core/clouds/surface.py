"""A cloud as an even sample of a surface: points with normals, weights K_i, and its roughness."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.cell_list import CellList, Points, voxel_downsample
from mpe_core.geometry.rigid import mirrored
from mpe_core.geometry.sampling import take_every
from mpe_core.geometry.viewpoints import nearest_viewpoint

VOXEL_SIZE = 0.015
"""Edge of the coarse thinning by default, in radii of the smaller cloud. From 0.012 to 0.015 all
shared pairs are found (docs/tuning.md)."""

MIN_RADIUS, MAX_RADIUS, RADIUS_GROWTH = 0.065, 0.3, 1.4
"""Radius of a neighbourhood, for the default voxel size: grown by the factor until it holds a
surface rather than noise (docs/tuning.md)."""

MIN_NEIGHBOURS, MAX_VARIATION = 12, 0.035
"""Median number of points and median surface variation at which a neighbourhood is taken: above the
variation of clean scans, below that of noisy ones (docs/tuning.md)."""

FLAT_WEIGHT = 0.02
"""Weight of a flat place, beside sqrt(surface variation): walls must not outweigh the rest."""

SUPPORT_SPACINGS = 6.0
"""Radius over the spacing of the points that a plane is fitted to, some 110 of them: a wide
neighbourhood of a dense cloud has ten times as many and no better plane."""

SUBSET_POINTS = 1500
"""Points, or up to twice as many, from which radius, roughness and spacing are estimated."""

MIN_DENSITY = 0.3
"""Share of the median number of neighbours under which a point counts as stray, of weight 0."""


@dataclass(frozen=True, slots=True)
class Surface:
    """Even sample of a normalized cloud; lengths in radii of the smaller cloud."""

    points: Points
    """(N, 3) points."""
    normals: Points
    """(N, 3) unit normals; zero where too few points lie around."""
    weights: Points
    """(N,) the paper's K_i: grows with the curvature, 0 for stray points."""
    roughness: float
    """Distance of the points from their local planes, at the quarter of the smoothest: noise."""
    spacing: float
    """Distance between neighbouring points, estimated from the number around a point."""
    oriented: bool = False
    """Whether the normals point out of the surface; otherwise to either side."""

    def mirrored(self) -> Surface:
        """Return the surface with x turned to -x."""
        return replace(self, points=mirrored(self.points), normals=mirrored(self.normals))


def fit_surface(points: Points, voxel_size: float = VOXEL_SIZE) -> Surface:
    """Thin a cloud (N, 3) to one point a voxel, and fit a plane of either sign around each."""
    sample = voxel_downsample(points, voxel_size)
    chosen = _choose_neighbourhood(sample, voxel_size)
    is_whole = len(chosen.support.points) == len(sample)
    cells = chosen.support if is_whole else CellList(sample, chosen.radius)
    planes = chosen.support.planes(cells.points)
    return Surface(
        points=cells.points,
        normals=planes.normals,
        weights=_curvature_weights(planes.surface_variation, planes.counts),
        roughness=chosen.roughness,
        spacing=chosen.spacing,
    )


def orient_normals(points: Points, normals: Points, viewpoints: NDArray[np.float64]) -> Points:
    """Turn the normals (N, 3) at the points (N, 3) to the nearest of the viewpoints (k, 3)."""
    nearest = viewpoints[nearest_viewpoint(points, viewpoints)]
    faces_away = np.einsum("ni,ni->n", normals, nearest - points) < 0
    turned: Points = np.where(faces_away[:, None], -normals, normals)
    return turned


@dataclass(frozen=True, slots=True)
class _Neighbourhood:
    """Neighbourhoods that hold a surface."""

    radius: float
    support: CellList
    """Points that planes are fitted to."""
    roughness: float
    """As that of `Surface`."""
    spacing: float
    """As that of `Surface`."""


def _choose_neighbourhood(sample: Points, voxel_size: float) -> _Neighbourhood:
    """Choose the neighbourhoods of a sample (N, 3) with one point a voxel."""
    subset = take_every(sample, SUBSET_POINTS)
    radius = MIN_RADIUS / VOXEL_SIZE * voxel_size
    largest = max(MAX_RADIUS, RADIUS_GROWTH * radius)
    roughness, spacing = largest, 0.0
    while True:
        support = _support(sample, radius, voxel_size)
        planes = support.planes(subset)
        usable = planes.counts >= MIN_NEIGHBOURS // 2
        variation = float(np.median(planes.surface_variation[usable])) if usable.any() else 1.0
        neighbours = float(np.median(planes.counts))
        has_neighbours = neighbours >= MIN_NEIGHBOURS
        if not spacing and (has_neighbours or radius >= largest):
            spacing = radius * float(np.sqrt(np.pi / max(neighbours, 1.0)))
        if has_neighbours:
            roughness = min(roughness, float(np.quantile(planes.plane_std[usable], 0.25)))
        if (has_neighbours and variation < MAX_VARIATION) or radius >= largest:
            return _Neighbourhood(radius, support, roughness, spacing)
        radius *= RADIUS_GROWTH


def _support(sample: Points, radius: float, voxel_size: float) -> CellList:
    """Points of the sample (N, 3) that planes of this radius are fitted to."""
    if radius >= SUPPORT_SPACINGS * voxel_size:
        sample = voxel_downsample(sample, radius / SUPPORT_SPACINGS)
    return CellList(sample, radius)


def _curvature_weights(variation: Points, count: NDArray[np.int32]) -> Points:
    weights = np.sqrt(variation) + np.float32(FLAT_WEIGHT)
    weights[count < MIN_DENSITY * np.median(count)] = 0
    return weights
