"""How well two levelled clouds match as seen from above, at any pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.rigid import apply
from mpe_core.search.levelled_cloud import CELL_SIZE, LevelledCloud
from mpe_core.search.levelled_pair import LevelledPair
from mpe_core.search.levelled_search import CONFLICT_WEIGHTS

Array = NDArray[np.float64]

MAX_GROUND_TILT_DEG, MAX_GROUND_OFFSET = 12.0, 0.1
"""Tilt and offset up to which the grounds of both clouds count as one."""

MIN_BEST_SHARE = 0.1
"""Share of the occupied cells of the emptier cloud that the best score has to reach: below it, what
is seen from above tells nothing (docs/tuning.md)."""


class LayerMatch:
    """Both clouds of a pair as seen from above, to be compared at any pose."""

    def __init__(self, pair: LevelledPair) -> None:
        """Draw the target, which stays."""
        self.pair = pair
        """The clouds as seen from above."""
        xy = pair.target.xy
        self._shift = CELL_SIZE - xy.min(axis=0)
        self._cells = int(np.ceil(np.ptp(xy, axis=0).max() / CELL_SIZE)) + 3
        self._fixed = pair.target.draw(np.eye(2), self._shift, self._cells)
        clouds = pair.target, pair.source[0]
        self._occupied = min(cloud.count_occupied() for cloud in clouds)
        self._known: dict[bytes, Array | None] = {}

    def relative_scores(self, poses: list[Array], is_plausible: list[bool]) -> list[float | None]:
        """Scores of poses T_target_source (4, 4) over those of the best plausible one.

        The mean over the weights of a conflict, from 0 to 1: noise on the ground looks like
        conflicts, and must not outweigh all else. None where the grounds of the clouds do not lie
        on each other at the pose, or no plausible pose matches.
        """
        scores = [self._known_scores(T) for T in poses]
        known = [
            score
            for score, plausible in zip(scores, is_plausible, strict=True)
            if plausible and score is not None
        ]
        if not known:
            return [None] * len(poses)
        best = np.max(known, axis=0)
        if best.min() < max(1.0, MIN_BEST_SHARE * self._occupied):
            return [None] * len(poses)
        return [
            None if score is None else max(0.0, float(np.clip(score / best, -1, 1).mean()))
            for score in scores
        ]

    def _known_scores(self, T: Array) -> Array | None:
        """Scores at a pose, which is compared anew at each level of a search."""
        key = T.tobytes()
        if key not in self._known:
            self._known[key] = self.scores(T)
        return self._known[key]

    def scores(self, T: Array) -> Array | None:
        """(K,) scores of the levelled search, one for each of its CONFLICT_WEIGHTS, at a pose.

        None where the grounds do not lie on each other at the pose.

        Parameters
        ----------
        T
            (4, 4) T_target_source.
        """
        source = next((cloud for cloud in self.pair.source if self._is_on_ground(cloud, T)), None)
        if source is None:
            return None
        # the pose in the levelled frames; what it tilts is below a cell
        A = (self.pair.target.R @ T[:3, :3] @ source.R.T)[:2, :2]
        foot = source.R.T @ np.array([0.0, 0.0, source.ground.height])
        b = (self.pair.target.R @ apply(T, foot[None])[0])[:2]
        moving, fixed = source.draw(A, b + self._shift, self._cells), self._fixed
        matches = int((moving.occupied & fixed.grown).sum())
        conflicts = int((moving.occupied & fixed.clear).sum())
        conflicts += int((moving.clear & fixed.occupied).sum())
        return matches - np.array(CONFLICT_WEIGHTS) * conflicts

    def _is_on_ground(self, source: LevelledCloud, T: Array) -> bool:
        """Whether the pose T lays the source's ground on that of the target."""
        ground = self.pair.target.ground
        if T[:3, :3] @ source.ground.up @ ground.up < np.cos(np.radians(MAX_GROUND_TILT_DEG)):
            return False
        foot = apply(T, (source.ground.height * source.ground.up)[None])[0]
        return bool(abs(foot @ ground.up - ground.height) <= MAX_GROUND_OFFSET)
