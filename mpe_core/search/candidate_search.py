"""The searches for candidate poses between two prepared clouds."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.preprocess import PreparedCloud
from mpe_core.progress import FractionCallback
from mpe_core.search.box_turns import box_turns
from mpe_core.search.levelled_effort import LevelledEffort
from mpe_core.search.levelled_pair import LevelledPair
from mpe_core.search.levelled_search import find_levelled_poses
from mpe_core.search.nearest_lattice import NearestLattice, build_lattice
from mpe_core.search.pose_prior import PosePrior
from mpe_core.search.pose_search import (
    TURNED,
    Candidates,
    SearchLevel,
    distinct_rows,
    find_poses,
)

Array = NDArray[np.float64]

NONE = Candidates(np.empty((0, 4, 4)), np.empty(0, np.float32))
"""Those of clouds that a search is not for."""


class CandidateSearch:
    """Searches between two prepared clouds; what they share is built once."""

    def __init__(
        self, source: PreparedCloud, target: PreparedCloud, prior: PosePrior, seed: int
    ) -> None:
        """Take the clouds.

        Parameters
        ----------
        source, target
            Prepared clouds.
        prior
            What the caller knows about the pose.
        seed
            Seed of the points that vote and descend.
        """
        self._source, self._target, self._prior, self._seed = source, target, prior, seed

    def find(
        self, level: SearchLevel, report: FractionCallback, rotations: Array | None = None
    ) -> Candidates:
        """Search at this level, best first; among rotations (K, 3, 3) alone, if there are any."""
        surface = self._source.surface
        return find_poses(surface, self._lattice, level, self._prior, self._seed, report, rotations)

    def find_levelled(
        self, pair: LevelledPair, effort: LevelledEffort, report: FractionCallback
    ) -> Candidates:
        """Search for poses that lay the grounds of both clouds on each other, best first."""
        found = [find_levelled_poses(source, pair.target, effort, report) for source in pair.source]
        poses = np.concatenate([each.poses for each in found])
        scores = np.concatenate([each.scores for each in found])
        accepted = self._prior.accepts(poses)
        poses, scores = poses[accepted], scores[accepted]
        kept = distinct_rows(poses, scores, effort.candidates)
        return Candidates(poses[kept], scores[kept])

    def find_turned(self, T: Array, report: FractionCallback) -> Candidates:
        """Search for poses that turn the pose T (4, 4) as a box fits on itself, best first."""
        turns = box_turns(self._source.surface)
        return self.find(TURNED, report, T[:3, :3] @ turns) if len(turns) else NONE

    @cached_property
    def _lattice(self) -> NearestLattice:
        return build_lattice(self._target.surface)
