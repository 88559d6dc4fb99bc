"""Normalized clouds at the two densities that a registration works on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.lattice import find_boundary
from mpe_core.clouds.normalize import CloudPair
from mpe_core.clouds.surface import VOXEL_SIZE, Surface, fit_surface, orient_normals
from mpe_core.errors import InvalidOptionsError
from mpe_core.geometry.cell_list import (
    CellList,
    Points,
    voxel_downsample,
    voxel_downsample_weighted,
)
from mpe_core.geometry.rigid import mirrored
from mpe_core.geometry.sampling import resample_rows, take_every
from mpe_core.options import RegistrationOptions

MIN_VOXEL_SIZE, MAX_VOXEL_SIZE = 1e-3, 0.2
"""Finest and coarsest thinning, in radii of the smaller cloud: a sphere keeps 12 million
and some 300 points."""

UNEVEN_VOXEL_SIZE = 0.045
"""Edge of the coarse thinning where few places hold nearly all points: else they outweigh the
rest of the surface."""

FINE_VOXEL_RATIO = 1 / 3
"""Edge of the fine thinning over that of the coarse one. It evens out the density around a scanner
and averages noise; the refinement is as exact as with the full clouds."""

SAMPLE_POINTS = 4000
"""Fine points that the refinement moves. More do not make it more exact (docs/tuning.md)."""

NORMAL_REACH_VOXELS = 2.0
"""Reach, in coarse edges, within which a fine point takes the normal of the nearest coarse one."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Subset of the fine points."""

    points: Points
    """(N, 3) points; N is at most SAMPLE_POINTS."""
    normals: Points | None
    """(N, 3) unit normals that point out of the surface; None if its outside is unknown."""

    def subset(self, count: int) -> Sample:
        """Every k-th of the points, about `count`."""
        normals = None if self.normals is None else take_every(self.normals, count)
        return Sample(take_every(self.points, count), normals)


@dataclass(frozen=True, slots=True)
class PreparedCloud:
    """Thinned cloud with its surface; lengths in radii of the smaller cloud."""

    fine: Points
    """(F, 3) at most one point in a cube of the fine edge."""
    weights: Points | None
    """(F,) the caller's weights, if there are any."""
    surface: Surface
    """Coarse points with normals."""
    voxel_size: float
    """Edge of the coarse thinning."""
    viewpoints: NDArray[np.float64] | None
    """(k, 3) places of the scanners, if they are known."""

    def mirrored(self) -> PreparedCloud:
        """Return the cloud with x turned to -x."""
        places = None if self.viewpoints is None else mirrored(self.viewpoints)
        return replace(
            self, fine=mirrored(self.fine), surface=self.surface.mirrored(), viewpoints=places
        )

    def sample(self, seed: int) -> Sample:
        """Draw up to SAMPLE_POINTS fine points, evenly or in proportion to their weights."""
        count = min(len(self.fine), SAMPLE_POINTS)
        if self.weights is None:
            rows = np.random.default_rng(seed).permutation(len(self.fine))[:count]
        else:
            rows = resample_rows(self.weights, count)
        points = self.fine[np.sort(rows)]
        return Sample(points, self._outward_normals(points) if self.surface.oriented else None)

    def coarse_points(self, count: int) -> Points:
        """Up to `count` of the surface's points (N, 3), evenly or in proportion to their weights.

        Those that look stray are among them: under noise most are not, and the pose would bend.
        """
        points = self.surface.points
        if self.weights is not None:
            weights = _weights_at(points, self.fine, self.weights, self.voxel_size)
            points = points[resample_rows(weights, len(points))]
        return np.ascontiguousarray(points[:: max(1, -(-len(points) // count))])

    def _outward_normals(self, points: Points) -> Points:
        """(N, 3) normals of the nearest coarse points; zero where none is near."""
        cells = CellList(self.surface.points, NORMAL_REACH_VOXELS * self.voxel_size)
        row, _ = cells.nearest(points)
        normals: Points = self.surface.normals[cells.rows[row]]
        normals[row < 0] = 0
        return normals


def prepare_clouds(
    pair: CloudPair, options: RegistrationOptions
) -> tuple[PreparedCloud, PreparedCloud]:
    """Thin both clouds, without their points of weight 0, and fit their surfaces.

    Raises
    ------
    InvalidOptionsError
        If `voxel_size` does not suit the size of the clouds.
    """
    usual = UNEVEN_VOXEL_SIZE if pair.is_uneven else VOXEL_SIZE
    voxel_size = usual if options.voxel_size is None else options.voxel_size / pair.unit
    if not MIN_VOXEL_SIZE <= voxel_size <= MAX_VOXEL_SIZE:
        raise InvalidOptionsError(
            f"voxel_size must be from {MIN_VOXEL_SIZE * pair.unit:.6g} to"
            f" {MAX_VOXEL_SIZE * pair.unit:.6g}, a thousandth and a fifth of the radius of the"
            f" smaller cloud, got {options.voxel_size}"
        )
    viewpoints = pair.viewpoints(options.source_viewpoint, options.target_viewpoint)
    source, target = (
        prepare_cloud(
            cloud.weighted(points),
            voxel_size,
            None if cloud.weights is None else cloud.weighted(cloud.weights),
            places,
        )
        for cloud, points, places in zip(
            (pair.source_cloud, pair.target_cloud),
            (pair.source, pair.target),
            viewpoints,
            strict=True,
        )
    )
    return source, target


def prepare_cloud(
    points: NDArray[np.float64],
    voxel_size: float = VOXEL_SIZE,
    weights: NDArray[np.float64] | None = None,
    viewpoints: NDArray[np.float64] | None = None,
) -> PreparedCloud:
    """Thin a normalized cloud and fit its surface.

    Parameters
    ----------
    points
        (N, 3) points in radii of the smaller cloud.
    voxel_size
        Edge of the coarse thinning.
    weights
        (N,) weights above 0.
    viewpoints
        (k, 3) places of the scanners, to the nearest of which the normals are turned.
    """
    boundary = find_boundary(points)
    if boundary is not None:
        points, weights = points[boundary], None if weights is None else weights[boundary]
    single = points.astype(np.float32)
    if weights is None:
        fine, fine_weights = voxel_downsample(single, FINE_VOXEL_RATIO * voxel_size), None
    else:
        fine, fine_weights = voxel_downsample_weighted(
            single, weights, FINE_VOXEL_RATIO * voxel_size
        )
    surface = fit_surface(fine, voxel_size)
    if fine_weights is not None:
        factor = _weights_at(surface.points, fine, fine_weights, voxel_size)
        surface = replace(surface, weights=surface.weights * factor)
    if viewpoints is not None:
        outward = orient_normals(surface.points, surface.normals, viewpoints)
        surface = replace(surface, normals=outward, oriented=True)
    return PreparedCloud(fine, fine_weights, surface, voxel_size, viewpoints)


def _weights_at(queries: Points, fine: Points, weights: Points, reach: float) -> Points:
    """(N,) weight of the fine point nearest to each query (N, 3); 0 where none is near."""
    cells = CellList(fine, reach)
    row, _ = cells.nearest(queries)
    nearest: Points = np.where(row >= 0, weights[cells.rows[row]], np.float32(0))
    return nearest
