"""The default method: search over all poses, polish, and a wider search where the result does not
convince."""

from __future__ import annotations

import numpy as np

from mpe_core.evaluator import PoseEvaluator, ScoredPose
from mpe_core.progress import Progress
from mpe_core.search.pose_search import SEARCH_LEVELS, SearchLevel, distinct

RIVAL = 0.7
"""Candidates that score at least this share of the best are polished and compared."""

AS_SHARP, AS_ON = 0.08, 0.05
"""Another pose fits as well if its evidence falls short by no more than this. The next best pose of
85 shared pairs and 166 composed from them falls short of the right one by 0.14 and more in
sharpness, on streets by 0.08 to 0.11 and by 0.2 in the share that lies on the target."""


def align(alignment: PoseEvaluator, progress: Progress) -> list[ScoredPose]:
    """The pose with the best evidence, then those that have as much of it; a wider search follows
    one that does not convince."""
    found: list[ScoredPose] = []
    for effort in SEARCH_LEVELS:
        with progress.stage("search") as report:
            candidates = alignment.search(effort, report)
        with progress.stage("refine") as report:
            rows = alignment.promising(candidates.poses, lambda share: report(share / 2))
            for done, k in enumerate(rows):
                report(0.5 + 0.5 * done / len(rows))
                rival = candidates.scores[k] >= RIVAL * candidates.scores[0]
                if rival or not _enough(found, effort):
                    found.append(alignment.polish(candidates.poses[k]))
        if _enough(found, effort):
            break
    return _equals(sorted(found, key=lambda pose: pose.evidence.rank, reverse=True))


def _equals(found: list[ScoredPose]) -> list[ScoredPose]:
    """The first of the poses, and those that differ from it with as much evidence."""
    best = found[0].evidence
    poses = np.array([pose.polished.T for pose in found])
    return [
        found[row]
        for row in distinct(poses, -np.arange(len(found), dtype=np.float32), len(found))
        if row == 0
        or (
            best.accepted
            and found[row].evidence.sharp > best.sharp - AS_SHARP
            and found[row].evidence.on > best.on - AS_ON
        )
    ]


def _enough(found: list[ScoredPose], effort: SearchLevel) -> bool:
    return any(pose.evidence.confidence >= effort.enough for pose in found)
