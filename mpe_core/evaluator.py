"""Two clouds prepared for searching, polishing and judging any number of poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.assess.confidence import LIKE_SIZES, Evidence, evidence, sharp_distance
from mpe_core.assess.covariance import (
    PROBED_POINTS,
    PoseUncertainty,
    count_degenerate,
    potential_uncertainty,
    surface_information,
    uncertainty,
)
from mpe_core.clouds.preprocess import PreparedCloud, Sample
from mpe_core.clouds.surface import Surface
from mpe_core.geometry.cell_list import CellList, LocalPlanes, Points
from mpe_core.geometry.rigid import apply, inverse
from mpe_core.options import RegistrationOptions
from mpe_core.refine.full_sum import EPS, descend_potential
from mpe_core.refine.minimum import Minimum
from mpe_core.refine.point_to_plane import (
    SMOOTHED,
    TargetPlanes,
    nearest_planes,
    point_to_plane,
    spread,
)
from mpe_core.search.nearest_lattice import NearestLattice, nearest_lattice
from mpe_core.search.pose_prior import PosePrior
from mpe_core.search.pose_search import Candidates, SearchLevel, find_poses

Pose = NDArray[np.float64]

NOISY, NOISY_SPARSE = 0.013, 0.0095
"""Roughness from which on noise hides the planes, for dense and for sparse clouds (at most
POTENTIAL_POINTS): both get wider planes, and for sparse ones the full-sum potential takes over.
Roughness of the shared clouds: at most 0.013; of the bunny of 1,889 points with noise 0.01 0.010,
0.02 0.017. With 0.0095 for all, facades end 0.2 degrees off instead of 0.05; with 0.013 for all,
the bunny with noise 0.01 0.17 instead of 0.07."""

LEAST_NOISE = 0.01
QUARTER_OF_NORMAL = 0.3186
"""Least noise that the potential is told, in radii of the smaller cloud; and the lower quartile of
|z| of a standard normal z."""

POTENTIAL_POINTS = 4000
"""Points of each cloud in the full sum."""

MORE_ON = 0.02
"""Share of the points by which planes must lay more on the target than the full sum, to be
preferred. Bunny of 1,889 points, six seeds: noise 0.01 to 0.16, or 3,000 outliers, at most 0.013,
and twice the error or more; 3,000 outliers with noise 0.04 at least 0.033, and 1.5 degrees instead
of 2.6; 9,000 outliers at least 0.115, and 0.14 degrees instead of 2.6."""

MOST_POLISHED, SHORT = 8, 10
"""Candidates that are polished fully, and steps of the short polish that chooses them: of the 42
pairs of `SEARCH_LEVELS` it chooses 25 right out of 48, and all 48 polished fully give 25, too."""


@dataclass(frozen=True, slots=True)
class ScoredPose:
    """A polished pose with what speaks for it."""

    polished: Minimum
    evidence: Evidence


class PoseEvaluator:
    """Source and target prepared for polishing and judging any number of poses."""

    def __init__(
        self,
        source: PreparedCloud,
        target: PreparedCloud,
        knowledge: PosePrior,
        options: RegistrationOptions,
        larger: float = 1.0,
    ) -> None:
        """`larger` is the radius of the larger cloud over that of the smaller one. Near an initial
        pose there are no more places for chance than on a cloud of like size."""
        self.source, self.target, self._options = source, target, options
        self._knowledge = knowledge
        self._larger = larger if knowledge.initial is None else 1.0
        rough = max(source.surface.roughness, target.surface.roughness)
        self._sparse = min(len(source.fine), len(target.fine)) <= POTENTIAL_POINTS
        noisy = rough > (NOISY_SPARSE if self._sparse else NOISY)
        self._full_sum = noisy and self._sparse
        # a noisy cloud has no planes worth the name: the smoother one is the reference then
        self._flipped = noisy and source.surface.roughness < target.surface.roughness
        fixed, moving = (source, target) if self._flipped else (target, source)
        self._motions = (knowledge.inverse() if self._flipped else knowledge).motions()
        noise = rough if noisy else 0.0
        self._planes = TargetPlanes(fixed.fine, fixed.surface.spacing, noise, fixed.viewpoint)
        self._moving, self._sample = moving, moving.sample(options.seed)
        self._own_cells: CellList | None = None
        self._smooth_sample: Sample | None = None
        self._spacing = max(source.surface.spacing, target.surface.spacing)
        self._sharp = sharp_distance(self._spacing, rough)
        self._field: NearestLattice | None = None

    def judge(self, T: Pose) -> Evidence:
        """What speaks for a pose."""
        there = self._oriented(T)
        found = self._evidence(self._sample, there)
        if self._larger <= LIKE_SIZES:
            return found
        return replace(found, free=count_degenerate(self._information(there)))

    def _evidence(self, sample: Sample, T: Pose) -> Evidence:
        overlap = self._options.overlap or 1.0
        return evidence(sample, self._planes, T, self._sharp, self._spacing, overlap, self._larger)

    def promising(self, poses: NDArray[np.float64], report: Callable[[float], None]) -> list[int]:
        """Rows of up to MOST_POLISHED of the poses (K, 4, 4): those for which most speaks after a
        short polish of some points."""
        rows = list(range(len(poses)))
        if len(rows) <= MOST_POLISHED or self._full_sum:
            return rows[:MOST_POLISHED]
        probe = self._sample.part(PROBED_POINTS)
        confidence = []
        for done, T in enumerate(poses):
            report(done / len(poses))
            start = self._oriented(self._knowledge.level(T))
            found = point_to_plane(probe, self._planes, start, self._motions, SHORT)
            confidence.append(self._evidence(probe, found.T).confidence)
        return sorted(rows, key=lambda row: -confidence[row])[:MOST_POLISHED]

    def spacing(self) -> float:
        """Point spacing of the reference's fine points, in radii of the smaller cloud."""
        return self._planes.spacing()

    def distances(self, T: Pose) -> NDArray[np.float64]:
        """(up to POLISHED_POINTS,) distances of a sample at the pose T to the nearest fine points;
        infinite beyond the reach of the planes."""
        moved = apply(self._oriented(T), self._sample.points).astype(np.float32)
        return np.sqrt(self._planes.cells.nearest(moved)[1].astype(np.float64))

    def polish(self, T: Pose) -> ScoredPose:
        """The minimum next to a coarse pose."""
        T = self._knowledge.level(T)
        polished = self._polish_full_sum(T) if self._full_sum else self._polish_planes(T)
        return ScoredPose(polished, self.judge(polished.T))

    def _polish_planes(self, T: Pose) -> Minimum:
        planes, most = self._planes, self._options.max_iterations
        found = point_to_plane(self._sample, planes, self._oriented(T), self._motions, most)
        if self._smoothing_helps(found.T):
            if self._smooth_sample is None:
                self._smooth_sample = self._smoothed(self._sample)
            found = point_to_plane(
                self._smooth_sample, planes, found.T, self._motions, most, smooth=True
            )
        return replace(found, T=self._oriented(found.T))

    def _smoothing_helps(self, T: Pose) -> bool:
        """Whether the smoothed clouds lie closer to each other, at a pose of the sample. The few
        planes of sparse clouds would smooth shape, too."""
        if self._sparse:
            return False
        probe, planes = self._sample.part(PROBED_POINTS), self._planes
        sharp = nearest_planes(probe, planes, T)
        smooth = nearest_planes(self._smoothed(probe), planes, T, smooth=True)
        return spread(smooth, planes.cut) < SMOOTHED * spread(sharp, planes.cut)

    def _smoothed(self, sample: Sample) -> Sample:
        """The sample laid on the planes through its own neighbours."""
        return Sample(self._own_planes(sample).project(sample.points), sample.normals)

    def _own_planes(self, sample: Sample) -> LocalPlanes:
        """Planes through the neighbours of the sample in its own cloud."""
        if self._own_cells is None:
            self._own_cells = CellList(self._moving.fine, float(self._planes.cells.reach))
        return self._own_cells.planes(sample.points)

    def _information(self, T: Pose) -> NDArray[np.float64]:
        """What the surfaces tell of the motions, at a pose of the sample."""
        probe = self._sample.part(PROBED_POINTS)
        own_normals = self._own_planes(probe).normals
        return surface_information(probe, own_normals, self._planes, T, self._motions)

    def uncertainty(self, polished: Minimum) -> PoseUncertainty:
        """Of a polished pose, about the source's centroid and in radii."""
        T = polished.T
        if self._full_sum and not polished.is_planar:
            eps = EPS * _noise(self.source.surface, self.target.surface, T)
            found = potential_uncertainty(*self._coarse(), T, eps, self._knowledge.motions())
            return found.about(T[:3, 3])
        sample, smooth = self._sample, polished.is_smoothed
        if smooth and self._smooth_sample is not None:
            sample = self._smooth_sample
        there = self._oriented(T)
        found = uncertainty(
            sample, self._planes, there, self._information(there), self._motions, smooth=smooth
        )
        if self._flipped:
            found = found.seen_from_target(T)
        return found.about(T[:3, 3])

    def _polish_full_sum(self, T: Pose) -> Minimum:
        most = self._options.max_iterations
        polished = Minimum(T, False, 0)
        for _ in range(2):  # the noise is known once the pose is
            eps = EPS * _noise(self.source.surface, self.target.surface, polished.T)
            motions = self._knowledge.motions()
            polished = descend_potential(*self._coarse(), polished.T, eps, motions, most)
        # stray points look like noise, too; but planes lay the others on the surface
        planes = self._polish_planes(polished.T)
        gain = self.judge(planes.T).on - self.judge(polished.T).on
        return planes if gain > MORE_ON else polished

    def _coarse(self) -> tuple[Points, Points]:
        return self.source.coarse(POTENTIAL_POINTS), self.target.coarse(POTENTIAL_POINTS)

    def search(self, effort: SearchLevel, report: Callable[[float], None]) -> Candidates:
        """Candidate poses, best first."""
        if self._field is None:
            self._field = nearest_lattice(self.target.surface)
        return find_poses(
            self.source.surface, self._field, effort, self._knowledge, self._options.seed, report
        )

    def _oriented(self, T: Pose) -> Pose:
        """The pose of the sample on the planes."""
        return inverse(T) if self._flipped else T


def _noise(x: Surface, y: Surface, T: Pose) -> float:
    """Standard deviation of the distances from the planes of the smoother cloud, from their lower
    quartile: up to three quarters of them may be outliers."""
    if x.roughness < y.roughness:
        smooth, moved = x, apply(inverse(T), y.points[y.weights > 0])
    else:
        smooth, moved = y, apply(T, x.points[x.weights > 0])
    cells = CellList(smooth.points, 0.3)
    queries = moved[:: max(1, len(moved) // 2000)].astype(np.float32)
    row, _ = cells.nearest(queries)
    near = row >= 0
    normals = smooth.normals[cells.rows[row[near]]]
    residual = np.abs(np.einsum("ni,ni->n", cells.points[row[near]] - queries[near], normals))
    if not near.any():
        return LEAST_NOISE
    return max(float(np.quantile(residual, 0.25)) / QUARTER_OF_NORMAL, LEAST_NOISE)
