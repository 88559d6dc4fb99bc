"""Scoring of poses: whether the points near the target lie on its surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.assess.confidence import MAX_CALIBRATED_SIZE_RATIO, Evidence
from mpe_core.assess.free_space import FreeSpace
from mpe_core.assess.shape import shape_correlation, tells_shape
from mpe_core.geometry.cell_list import Points
from mpe_core.refine.regime import Regime
from mpe_core.refine.swapped import PlaneRefiner
from mpe_core.refine.target_planes import Correspondences

Array = NDArray[np.float64]

ON_SURFACE_TOL, ON_SURFACE_TOL_SPACINGS, ON_SURFACE_TOL_NOISES = 0.006, 0.3, 1.5
"""Distance from a plane that counts as on it: in radii of the smaller cloud, in point spacings and
in roughnesses, whichever is largest."""

MAX_TANGENTIAL_SPACINGS = 0.5
"""Distance along the plane, in point spacings, up to which a point lies over its nearest point.
Farther off the target has a hole or ends, and tells nothing about the pose (docs/tuning.md)."""

MAX_CHANCE_FOR_OVERLAP_TEST = 0.18
"""Share that chance puts on a plane up to which only points over a point of the target count.
Beyond it, noise decides which points these are (docs/tuning.md)."""

MAX_SHAPE_RADIUS = 0.085
"""Radius of the planes, in radii of the smaller cloud, up to which they tell shape: wider ones hold
several surfaces."""

CLOSE_SHARE = 0.5
"""Share of the planes' radius within which points meet whose shapes are compared: there, both
neighbourhoods are nearly the same."""

MAX_CHANCE = 0.9
"""Bound on the share that chance puts on a plane, so that some is left to tell poses apart."""


class PoseScorer:
    """Evidence for any pose of the source on the target."""

    def __init__(
        self,
        planes: PlaneRefiner,
        regime: Regime,
        overlap: float,
        size_ratio: float,
        free_space: FreeSpace | None = None,
        *,
        compares_shape: bool = True,
    ) -> None:
        """Choose the tolerances for a pair of clouds.

        Parameters
        ----------
        planes
            What matches points with planes.
        regime
            Noise and density of the pair.
        overlap
            Share of the source that can have a counterpart.
        size_ratio
            Radius of the larger cloud over that of the smaller one.
        free_space
            What both scanners saw through, where their positions are known.
        compares_shape
            Whether points have to meet points of the same local shape.
        """
        self._free_space = free_space
        self._planes, self._overlap, self._size_ratio = planes, overlap, size_ratio
        self._tolerance = max(
            ON_SURFACE_TOL,
            ON_SURFACE_TOL_SPACINGS * regime.spacing,
            ON_SURFACE_TOL_NOISES * regime.roughness,
        )
        self._max_tangential = MAX_TANGENTIAL_SPACINGS * regime.spacing
        self._tells_shape = (
            compares_shape
            and planes.radius <= MAX_SHAPE_RADIUS
            and tells_shape(planes.variation_of_subset)
            and tells_shape(planes.variation_of_fixed)
        )

    def score(self, T: Array) -> Evidence:
        """Measure the evidence for the pose T (4, 4)."""
        evidence = self._with_contradictions(
            self._evidence(self._planes.match(T), self._planes.variation), T
        )
        if self._size_ratio <= MAX_CALIBRATED_SIZE_RATIO:
            return evidence
        return replace(evidence, degenerate_dof=self._planes.count_degenerate(T))

    def score_subset(self, T: Array) -> Evidence:
        """Measure the evidence that a subset of the points gives for the pose T (4, 4)."""
        evidence = self._evidence(self._planes.match_subset(T), self._planes.variation_of_subset)
        return self._with_contradictions(evidence, T)

    def _with_contradictions(self, evidence: Evidence, T: Array) -> Evidence:
        """Add what speaks against the pose T (4, 4)."""
        if self._free_space is not None:
            evidence = replace(evidence, free_space_violation=self._free_space.violation(T))
        return evidence

    def _evidence(self, matches: Correspondences, variation: Points) -> Evidence:
        near = matches.in_range & (np.abs(matches.normals).sum(axis=1) > 0)
        residual = np.abs(matches.residuals())
        chance = min(self._tolerance / self._planes.radius, MAX_CHANCE)
        telling = near
        if chance < MAX_CHANCE_FOR_OVERLAP_TEST:
            tangential = np.square(matches.points - matches.moved).sum(axis=1) - np.square(residual)
            telling = near & (tangential < self._max_tangential**2)
        on_surface = near & (residual < self._tolerance)
        if self._free_space is None:  # otherwise it tells the sides of a surface better
            on_surface &= matches.valid
        share = float(on_surface[telling].mean()) if telling.any() else 0.0
        close = near & (matches.squared_distance < (CLOSE_SHARE * self._planes.radius) ** 2)
        return Evidence(
            coverage=float(near.mean()),
            on_surface_fraction=float(on_surface.mean()),
            surface_agreement=max(0.0, (share - chance) / (1 - chance)),
            overlap=self._overlap,
            size_ratio=self._size_ratio,
            shape_correlation=shape_correlation(variation[close], matches.variation[close])
            if self._tells_shape
            else None,
        )
