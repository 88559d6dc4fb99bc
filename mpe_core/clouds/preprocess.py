"""A centred, scaled cloud at the two densities that a registration works on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.surface import VOXEL, Surface, facing, surface
from mpe_core.geometry.cell_list import (
    CellList,
    Points,
    voxel_downsample,
    voxel_downsample_weighted,
)
from mpe_core.geometry.sampling import resample_rows

FINE = 1 / 3
"""Edge of the fine thinning over that of the coarse one, 0.005 radii of the smaller cloud by
default. It evens out what lies near a scanner and averages noise; rotation errors after the polish
as with the full clouds."""

POLISHED_POINTS = 4000
"""Fine points that the polish moves. 4,000 / 8,000 / 16,000, median over bunny / dragon / uwa_chef:
0.07 / 0.16 / 0.02, 0.07 / 0.16 / 0.03, 0.07 / 0.16 / 0.03 degrees."""

OWN_REACH = 2.0
"""How far a fine point may lie from the coarse one that stands for it, in coarse edges."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Some of the fine points."""

    points: Points
    """(N, 3), N up to POLISHED_POINTS."""
    normals: Points | None
    """(N, 3) unit normals that point out of the surface, where it is known which side that is."""

    def part(self, most: int) -> Sample:
        """About `most` of them, evenly."""
        every = max(1, len(self.points) // most)
        normals = None if self.normals is None else self.normals[::every]
        return Sample(self.points[::every].copy(), normals)


@dataclass(frozen=True, slots=True)
class PreparedCloud:
    """One cloud; all lengths in radii of the smaller cloud."""

    fine: Points
    """(F, 3) at most one point in a cube of the fine edge."""
    weights: Points | None
    """(F,) the caller's weights, if there are any."""
    surface: Surface
    """Even sample with normals."""
    voxel: float
    """Edge of the coarse thinning."""
    viewpoint: NDArray[np.float64] | None
    """(3,) where the scanner stood, if that is known."""

    def sample(self, seed: int) -> Sample:
        """Fine points, drawn evenly, or each as often as its weight asks for."""
        count = min(len(self.fine), POLISHED_POINTS)
        if self.weights is None:
            rows = np.random.default_rng(seed).permutation(len(self.fine))[:count]
        else:
            rows = resample_rows(self.weights, count)
        points = self.fine[np.sort(rows)]
        return Sample(points, self._outward(points) if self.surface.oriented else None)

    def coarse(self, most: int) -> Points:
        """(up to `most`, 3) of the surface's points, evenly or as their weights ask for; those that
        look stray, too: under noise most of them are not, and the pose would bend."""
        points = self.surface.points
        if self.weights is not None:
            weights = _at(points, self.fine, self.weights, self.voxel)
            points = points[resample_rows(weights, len(points))]
        return np.ascontiguousarray(points[:: max(1, -(-len(points) // most))])

    def _outward(self, points: Points) -> Points:
        cells = CellList(self.surface.points, OWN_REACH * self.voxel)
        row, _ = cells.nearest(points)
        normals: Points = self.surface.normals[cells.rows[row]]
        normals[row < 0] = 0
        return normals


def scan(
    points: NDArray[np.float64],
    voxel: float = VOXEL,
    weights: NDArray[np.float64] | None = None,
    viewpoint: NDArray[np.float64] | None = None,
) -> PreparedCloud:
    """Thin a centred, scaled cloud (N, 3) and fit its surface; weights (N,) above 0."""
    single = points.astype(np.float32)
    if weights is None:
        fine, kept = voxel_downsample(single, FINE * voxel), None
    else:
        fine, kept = voxel_downsample_weighted(single, weights, FINE * voxel)
    coarse = surface(fine, voxel)
    if kept is not None:
        coarse = replace(coarse, weights=coarse.weights * _at(coarse.points, fine, kept, voxel))
    if viewpoint is not None:
        outward = facing(coarse.points, coarse.normals, viewpoint)
        coarse = replace(coarse, normals=outward, oriented=True)
    return PreparedCloud(fine, kept, coarse, voxel, viewpoint)


def _at(queries: Points, fine: Points, weights: Points, reach: float) -> Points:
    """(N,) weight of the fine point nearest to each query (N, 3)."""
    cells = CellList(fine, reach)
    row, _ = cells.nearest(queries)
    found: Points = np.where(row >= 0, weights[cells.rows[row]], np.float32(0))
    return found
