"""A cloud as an even sample of a surface: thinned points with normals, weights K_i and
roughness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.cell_list import CellList, LocalPlanes, Points, voxel_downsample

VOXEL = 0.015
"""Edge of the thinning cubes in radii of the smaller cloud (design study: 1.2-1.5 % keeps all 85
pairs)."""

LEAST_RADIUS, MOST_RADIUS, GROWTH = 0.065, 0.3, 1.4
"""Radius of a neighbourhood in the same unit: grown until it holds a surface rather than noise.
0.08 instead of 0.065 to begin with: the same 255 of 255 shared trials right, a tenth slower."""

ENOUGH_NEIGHBOURS, SMOOTH = 12, 0.035
"""Median points and median surface variation at which a neighbourhood is taken. Bunny of 1,889
points: variation 0.011 clean, 0.03 with noise 0.01 of the radius, 0.08 with 0.02, 0.14 with
0.04."""

FLAT_WEIGHT = 0.02
"""K of a flat place beside sqrt(surface variation): walls must not outweigh the rest."""

SUPPORT = 6.0
"""Radius over the spacing of the points that a plane is fitted to, some 110 of them: a wide
neighbourhood of a dense cloud has ten times as many and no better plane."""

PROBES = 1500
"""Points, or up to twice as many, that radius, roughness and spacing are told from."""

SPARSE = 0.3
"""Places with fewer neighbours than this share of the median are stray points, of weight 0."""


@dataclass(frozen=True, slots=True)
class Surface:
    """Even sample of a centred, scaled cloud."""

    points: Points
    """(N, 3) in units of the smaller cloud's radius."""
    normals: Points
    """(N, 3) unit normals, zero where too few points lie around."""
    weights: Points
    """(N,) the paper's K_i: curvature, and 0 for stray points."""
    roughness: float
    """Distance of the points from their local planes where it is small (25 % are nearer): noise."""
    spacing: float
    """Distance between neighbouring points of the sample, from how many lie around a point."""
    oriented: bool = False
    """Whether the normals point out of the surface rather than to either side."""


def surface(points: Points, voxel: float = VOXEL) -> Surface:
    """Thin a cloud (N, 3) to one point a voxel and fit a plane of either sign around each."""
    sample = voxel_downsample(points, voxel)
    radius, roughness, spacing = _neighbourhood(sample, voxel)
    points = CellList(sample, radius).points
    planes = _planes(points, sample, radius, voxel)
    return Surface(
        points=points,
        normals=planes.normals,
        weights=_weights(planes.surface_variation, planes.counts),
        roughness=roughness,
        spacing=spacing,
    )


def _neighbourhood(sample: Points, voxel: float) -> tuple[float, float, float]:
    """Radius of the neighbourhoods that hold a surface, roughness and spacing of the points, from
    some of them."""
    some = sample[:: max(1, len(sample) // PROBES)].copy()
    radius = LEAST_RADIUS / VOXEL * voxel
    most = max(MOST_RADIUS, GROWTH * radius)
    rough, spacing = most, 0.0
    while True:
        planes = _planes(some, sample, radius, voxel)
        usable = planes.counts >= ENOUGH_NEIGHBOURS // 2
        flat = float(np.median(planes.surface_variation[usable])) if usable.any() else 1.0
        neighbours = float(np.median(planes.counts))
        if not spacing and (neighbours >= ENOUGH_NEIGHBOURS or radius >= most):
            spacing = radius * float(np.sqrt(np.pi / max(neighbours, 1.0)))
        if neighbours >= ENOUGH_NEIGHBOURS:
            rough = min(rough, float(np.quantile(planes.plane_std[usable], 0.25)))
        if (neighbours >= ENOUGH_NEIGHBOURS and flat < SMOOTH) or radius >= most:
            return radius, rough, spacing
        radius *= GROWTH


def _planes(queries: Points, sample: Points, radius: float, voxel: float) -> LocalPlanes:
    """Planes through the sample around the queries (N, 3)."""
    support = sample if radius < SUPPORT * voxel else voxel_downsample(sample, radius / SUPPORT)
    return CellList(support, radius).planes(queries)


def facing(points: Points, normals: Points, viewpoint: NDArray[np.float64]) -> Points:
    """The normals (N, 3) at the points (N, 3), turned to where they were seen from."""
    away = np.einsum("ni,ni->n", normals, viewpoint - points) < 0
    turned: Points = np.where(away[:, None], -normals, normals)
    return turned


def _weights(variation: Points, count: NDArray[np.int32]) -> Points:
    weights = np.sqrt(variation) + np.float32(FLAT_WEIGHT)
    weights[count < SPARSE * np.median(count)] = 0
    return weights
