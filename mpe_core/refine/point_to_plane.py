"""From a coarse pose to the minimum on the full clouds: point to plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.preprocess import Sample
from mpe_core.clouds.surface import facing
from mpe_core.geometry.cell_list import CellList, Points
from mpe_core.geometry.rigid import apply
from mpe_core.kernels.plane_equations import plane_equations
from mpe_core.kernels.rigid_motion import update_pose
from mpe_core.refine.minimum import Minimum

Pose = NDArray[np.float64]

PLANE_RADIUS = 0.04
PLANE_SPACINGS = 2.8
"""Radius of the target's local planes: in radii of the smaller cloud, and in point spacings if
that is more. Rotation error, median over bunny / dragon / uwa_chef: 0.04 0.09 / 0.14 / 0.02
degrees, 0.06 0.08 / 0.15 / 0.02, 0.08 0.06 / 0.15 / 0.03. A LiDAR pair ends 1.2 degrees
off with 2.5 spacings, 0.2 with 2.8; with 3.3 dragon 264-192 is no longer accepted; planes of the
coarsely thinned cloud 0.18 / 0.19 / 0.20."""

CUT = 0.007
CUT_SPACINGS = 0.45
"""Tukey's cut-off, likewise. Rotation error, median over bunny / dragon / uwa_chef, four starts:
0.005 and 0.25 spacings 0.077 / 0.139 / 0.019 degrees, 0.007 and 0.45 0.071 / 0.146 / 0.020, 0.01
and 0.5 0.074 / 0.151 / 0.018, 0.014 0.079 / 0.153 / 0.040; but a room ends 0.41 degrees off with
0.25 spacings instead of 0.24, a LiDAR car 0.22 instead of 0.1. The views of dragon differ from
their ground truth by more than from each other (`docs/method.md`)."""

PLANE_NOISES, CUT_NOISES = 6.0, 3.0
"""Both likewise in roughnesses, for noisy clouds. Bunny of 35,947 points, median rotation error
over that of the fit with known correspondences, noise 0.015 / 0.03 / 0.06: 6.5 / 5.5 / 17.7; with
3 roughnesses for the radius 7.1 / 7.9 / 35; the full sum over 4,000 points of each 14 / 11 / 15."""

SMOOTHED = 0.9
"""Smoothing both clouds is right where it shrinks the residual to this share: it evens out noise
then, rather than shape. Of the 85 shared pairs it does so for the 17 with the noise of a depth
camera and a scan of the bunny (shares 0.37 to 0.89; with it the fgr pairs end 0.035 degrees off,
without it 0.105); others have 0.92 to 1.7, and facades would end 0.11 degrees off instead of
0.03."""

FIRST_CUT = 3.0
"""The first steps, which bring the pose near, cut off this many times later."""

STILL = 2e-5
"""A step that turns by fewer radians (0.001 degrees) and moves by fewer radii ends the iteration:
the nearest points keep changing places below that."""

MOST_STEPS = 30
"""Steps of a polish; 255 real registrations took 7 in the median and 20 at the 95th percentile."""

SPACING_SAMPLE = 1000
"""Points asked how many lie around them."""


class TargetPlanes:
    """The full target with planes through it, fitted where they are first asked for."""

    def __init__(
        self,
        points: Points,
        spacing: float,
        noise: float = 0.0,
        viewpoint: NDArray[np.float64] | None = None,
    ) -> None:
        reach = max(PLANE_RADIUS, PLANE_SPACINGS * spacing, PLANE_NOISES * noise)
        self.cells = CellList(points, reach)
        self.cut = max(CUT, CUT_SPACINGS * spacing, CUT_NOISES * noise)
        self._normals = np.zeros_like(self.cells.points)
        self._feet = self.cells.points.copy()
        self._known = np.zeros(len(points), np.bool_)
        self._viewpoint = viewpoint

    def at(self, rows: NDArray[np.int32]) -> tuple[Points, Points]:
        """(N, 3) places on the planes at the rows (N,) of `cells.points`, and their unit normals;
        zero where too few points lie. They point to the viewpoint, or to either side if it is
        unknown."""
        new = np.unique(rows[~self._known[rows]])
        if len(new):
            points = self.cells.points[new]
            planes, seen = self.cells.planes(points), self._viewpoint
            fitted = planes.normals
            self._feet[new] = planes.project(points)
            self._normals[new] = fitted if seen is None else facing(points, fitted, seen)
            self._known[new] = True
        return self._feet[rows], self._normals[rows]

    def spacing(self) -> float:
        """Distance between neighbouring points, from how many lie within reach of some of them."""
        points = self.cells.points
        some = points[:: max(1, len(points) // SPACING_SAMPLE)].copy()
        count = self.cells.planes(some).counts
        return float(self.cells.reach) * float(np.sqrt(np.pi / np.median(count)))


@dataclass(frozen=True, slots=True)
class Correspondences:
    """Source points at a pose, each with the plane of the target next to it."""

    moved: Points
    """(N, 3) R x_i + t."""
    points: Points
    """(N, 3) the nearest points of the target."""
    normals: Points
    """(N, 3) unit normals there; zero where too few points lie."""
    within: NDArray[np.bool_]
    """(N,) whether there is one within reach."""
    used: NDArray[np.bool_]
    """(N,) whether it faces as the source does, too."""

    def residuals(self) -> Points:
        """(N,) distances from the planes, of either sign."""
        residuals: Points = np.einsum("ni,ni->n", self.points - self.moved, self.normals)
        return residuals

    def weights(self, cut: float) -> NDArray[np.float64]:
        """(N,) Tukey's weights of the residuals; 0 for points that are not used."""
        u = self.residuals().astype(np.float64) / cut
        return np.where(self.used, np.maximum(0, 1 - u**2) ** 2, 0)


def nearest_planes(
    source: Sample, target: TargetPlanes, T: Pose, *, smooth: bool = False
) -> Correspondences:
    """The target's planes next to the source at the pose T: through its points, or `smooth`, as
    they were fitted."""
    moved = apply(T, source.points).astype(np.float32)
    row, _ = target.cells.nearest(moved)
    within = row >= 0
    row = np.where(within, row, 0).astype(np.int32)
    feet, normals = target.at(row)
    points = feet if smooth else target.cells.points[row]
    used = within
    if source.normals is not None:
        outward = np.einsum("ij,nj->ni", T[:3, :3].astype(np.float32), source.normals)
        used = within & (np.einsum("ni,ni->n", outward, normals) >= 0)
    return Correspondences(moved, points, normals, within, used)


def point_to_plane(
    source: Sample,
    target: TargetPlanes,
    T: Pose,
    motions: NDArray[np.float64],
    max_iterations: int,
    *,
    smooth: bool = False,
) -> Minimum:
    """Minimise sum rho(n_j*.(y_j* - (R x_i + t))) from the pose T, y_j* the nearest point of the
    target and rho Tukey's biweight (Chen and Medioni 1991; robust loss after Babin et al. 2019), by
    steps within the `motions` (6, K)."""
    iterations = 0
    most = min(max_iterations, MOST_STEPS)
    for cut in (FIRST_CUT * target.cut, target.cut):
        converged = False
        while not converged and iterations < most:
            H, g = equations(nearest_planes(source, target, T, smooth=smooth), cut)
            iterations += 1
            # a share of the trace holds the directions in which the surface slides on itself
            H += (1e-9 * np.trace(H) + 1e-30) * np.eye(6)
            step = motions @ np.linalg.solve(motions.T @ H @ motions, motions.T @ g)
            T = T.copy()
            update_pose(T, step)
            converged = bool(np.abs(step).max() < (STILL if cut == target.cut else 20 * STILL))
    return Minimum(T, converged, iterations, is_planar=True, is_smoothed=smooth)


def spread(pairs: Correspondences, cut: float) -> float:
    """Root mean square of the residuals, weighted as in the polish."""
    weight, r = pairs.weights(cut), pairs.residuals().astype(np.float64)
    return float(np.sqrt((weight * r**2).sum() / max(weight.sum(), 1e-30)))


def equations(
    pairs: Correspondences, cut: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(6, 6) normal matrix and (6,) right side of one step."""
    H, g = plane_equations(pairs.moved, pairs.points, pairs.normals, pairs.used, np.float32(cut))
    return H.sum(axis=0), g.sum(axis=0)
