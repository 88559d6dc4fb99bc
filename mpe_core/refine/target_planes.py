"""Local planes of a fixed cloud, and the points of a moving cloud matched with them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.preprocess import Sample
from mpe_core.clouds.surface import orient_normals
from mpe_core.geometry.cell_list import CellList, Points
from mpe_core.geometry.rigid import apply
from mpe_core.geometry.sampling import take_every
from mpe_core.kernels.plane_descent import mark_unknown

Array = NDArray[np.float64]

PLANE_RADIUS, PLANE_RADIUS_SPACINGS, PLANE_RADIUS_NOISES = 0.04, 2.8, 6.0
"""Radius of the planes in radii of the smaller cloud, in point spacings and in noises, whichever is
largest. Smaller ones fail on LiDAR, larger ones lose small overlaps (docs/tuning.md)."""

TUKEY_CUTOFF, TUKEY_CUTOFF_SPACINGS, TUKEY_CUTOFF_NOISES = 0.007, 0.45, 3.0
"""Cut-off of Tukey's biweight in the same units. Smaller ones lose accuracy on LiDAR and in rooms,
larger ones on clean scans (docs/tuning.md)."""

SPACING_SUBSET_POINTS = 1000
"""Points of which the neighbours are counted to estimate the spacing."""


class TargetPlanes:
    """Local planes at all points of a fixed cloud, fitted where they are first asked for."""

    def __init__(
        self,
        points: Points,
        spacing: float,
        noise: float = 0.0,
        viewpoints: Array | None = None,
        *,
        width: float = 1.0,
    ) -> None:
        """Choose radius and cut-off for the points (M, 3).

        Parameters
        ----------
        points
            (M, 3) points in radii of the smaller cloud.
        spacing
            Point spacing of the cloud's surface.
        noise
            Noise that the planes have to average.
        viewpoints
            (k, 3) places of the scanners, to the nearest of which the normals are turned.
        width
            Radius and cut-off over the usual ones.
        """
        radius = width * max(
            PLANE_RADIUS, PLANE_RADIUS_SPACINGS * spacing, PLANE_RADIUS_NOISES * noise
        )
        self.cells = CellList(points, radius)
        self.cutoff = width * max(
            TUKEY_CUTOFF, TUKEY_CUTOFF_SPACINGS * spacing, TUKEY_CUTOFF_NOISES * noise
        )
        self._normals = np.zeros_like(self.cells.points)
        self._feet = self.cells.points.copy()
        self._variation = np.zeros(len(points), np.float32)
        self.is_fitted = np.zeros(len(points), np.bool_)
        """(M,) whether the plane at a row of `cells.points` was fitted."""
        self._viewpoints = viewpoints

    @property
    def radius(self) -> float:
        """Radius of the planes, and reach of the matching."""
        return float(self.cells.reach)

    def planes_at(self, rows: NDArray[np.int32]) -> tuple[Points, Points, Points]:
        """Planes at the rows (N,) of `cells.points`.

        Returns
        -------
        feet
            (N, 3) points projected on their planes.
        normals
            (N, 3) unit normals; zero where too few points lie around. They point to the nearest
            viewpoint, or to either side if there is none.
        variation
            (N,) surface variation around each point; NaN at the border of the cloud.
        """
        self.fit_nearest(rows[None], np.zeros(1, np.int64))
        return self._feet.take(rows, 0), self._normals.take(rows, 0), self._variation[rows]

    def planes(self, *, smooth: bool) -> tuple[Points, Points]:
        """Return the planes at all rows of `cells.points`, as far as they were fitted.

        Parameters
        ----------
        smooth
            Whether the planes are taken as fitted; otherwise each is moved to its point.

        Returns
        -------
        A point (M, 3) of each plane and the unit normals (M, 3), as those of `planes_at`.
        """
        return self._feet if smooth else self.cells.points, self._normals

    def fit_nearest(self, nearest: NDArray[np.int32], poses: NDArray[np.int64]) -> None:
        """Fit the planes that some of the poses (A,) ask for, by rows (K, N), -1 for none."""
        rows = mark_unknown(nearest, poses, self.is_fitted)
        if len(rows) == 0:
            return
        points = self.cells.points.take(rows, 0)
        planes = self.cells.planes(points)
        normals = planes.normals
        if self._viewpoints is not None:
            normals = orient_normals(points, normals, self._viewpoints)
        self._feet[rows], self._normals[rows] = planes.project(points), normals
        self._variation[rows] = planes.comparable_variation(self.radius)

    def variation_of_subset(self) -> Points:
        """(N,) surface variation at some of the points."""
        return self.cells.planes(
            take_every(self.cells.points, SPACING_SUBSET_POINTS)
        ).comparable_variation(self.radius)

    def point_spacing(self) -> float:
        """Distance between neighbouring points, estimated from the number within the radius."""
        points = self.cells.points
        subset = take_every(points, SPACING_SUBSET_POINTS)
        count = self.cells.planes(subset).counts
        return self.radius * float(np.sqrt(np.pi / np.median(count)))


@dataclass(frozen=True, slots=True)
class Correspondences:
    """Points of a sample at a pose, each with the plane at the nearest point of the fixed cloud."""

    moved: Points
    """(N, 3) points of the sample at the pose."""
    points: Points
    """(N, 3) nearest points of the fixed cloud, or their projections on their planes."""
    normals: Points
    """(N, 3) unit normals of the planes; zero where too few points lie around."""
    squared_distance: Points
    """(N,) squared distances of the nearest points; infinite where none is in range."""
    in_range: NDArray[np.bool_]
    """(N,) whether a point of the fixed cloud is within the radius of the planes."""
    valid: NDArray[np.bool_]
    """(N,) whether it is in range and its normal does not oppose that of the sample."""
    variation: Points
    """(N,) surface variation of the fixed cloud around the nearest points."""

    def distances(self) -> Array:
        """(N,) distances of the nearest points; infinite where none is in range."""
        return np.sqrt(self.squared_distance.astype(np.float64))

    def residuals(self) -> Points:
        """(N,) signed distances from the planes."""
        residuals: Points = np.einsum("ni,ni->n", self.points - self.moved, self.normals)
        return residuals

    def tukey_weights(self, cutoff: float) -> Array:
        """(N,) Tukey's weights of the residuals; 0 for points that are not valid."""
        u = self.residuals().astype(np.float64) / cutoff
        return np.where(self.valid, np.maximum(0, 1 - u**2) ** 2, 0)

    def weighted_rms(self, cutoff: float) -> float:
        """Root mean square of the residuals under Tukey's weights."""
        weight, r = self.tukey_weights(cutoff), self.residuals().astype(np.float64)
        return float(np.sqrt((weight * r**2).sum() / max(weight.sum(), 1e-30)))


def match_planes(
    sample: Sample, target: TargetPlanes, T: Array, *, smooth: bool = False
) -> Correspondences:
    """Match the sample at the pose T with the planes of the target.

    Parameters
    ----------
    sample
        Points of the moving cloud.
    target
        Planes of the fixed cloud.
    T
        (4, 4) pose of the moving cloud in the frame of the fixed one.
    smooth
        Whether the planes are taken as fitted; otherwise each is moved to its point.
    """
    moved = apply(T, sample.points).astype(np.float32)
    row, squared = target.cells.nearest(moved)
    in_range = row >= 0
    row = np.where(in_range, row, 0).astype(np.int32)
    feet, normals, variation = target.planes_at(row)
    points = feet if smooth else target.cells.points.take(row, 0)
    valid = in_range
    if sample.normals is not None:
        outward = np.einsum("ij,nj->ni", T[:3, :3].astype(np.float32), sample.normals)
        valid = in_range & (np.einsum("ni,ni->n", outward, normals) >= 0)
    return Correspondences(moved, points, normals, squared, in_range, valid, variation)
