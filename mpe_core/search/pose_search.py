"""Search for candidate poses: votes for translations, then descents on the P2 energy."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.surface import Surface
from mpe_core.geometry.sampling import sample_spread_rows
from mpe_core.kernels.energy_descent import descend_poses
from mpe_core.kernels.translation_votes import BINS_PER_EDGE, best_translations
from mpe_core.options import ACCEPTANCE_THRESHOLD
from mpe_core.progress import FractionCallback
from mpe_core.search.levelled_effort import QUICK_LEVELLED, THOROUGH_LEVELLED, LevelledEffort
from mpe_core.search.nearest_lattice import NearestLattice
from mpe_core.search.pose_prior import PosePrior

Poses = NDArray[np.float64]

MIN_NORMAL_AGREEMENT = 0.75
"""|n.c| from which on a target point votes in the direction bin around c: 41 degrees. Without
normals good candidates rank lower (docs/tuning.md)."""

TANGENTIAL_WEIGHT = 0.02
"""Weight of the tangential residual beside the normal one: large ones slow the descent and hold
surfaces back that should slide (docs/tuning.md)."""

PRUNE_BELOW = 0.4
"""Share of the best score under which candidates are dropped after a stage: saves three quarters of
the time of easy pairs and loses no pose (docs/tuning.md)."""

MIN_APART_DEG, MIN_APART = 8.0, 0.1
"""Poses closer than both, in degrees and radii of the smaller cloud, count as one."""

MAX_HISTOGRAM_CELLS = 300_000
"""Bound on a histogram of votes, 0.6 MB; a target much larger than the source gets larger cells."""

MIN_EPS_NOISES = 1.5
"""Smallest eps of a descent over the noise: below it there is nothing to descend to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnnealingStage:
    """One round of descents with falling eps; lengths in radii of the smaller cloud."""

    points: int
    """Points of the source that descend."""
    start_eps: float
    """eps of the first step."""
    end_eps: float
    """eps of the last step."""
    steps: int
    """Steps of a descent."""
    keep: int
    """Candidates that are kept."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchLevel:
    """Effort of one search; lengths in radii of the smaller cloud."""

    rotations: int
    """Rotations over SO(3) to vote for."""
    source_points: int
    """Points of the source that vote."""
    target_points: int
    """Points of the target that vote."""
    cell_size: float
    """Edge of a cell of the vote histogram."""
    candidates: int
    """Poses with the most votes that descend."""
    stages: tuple[AnnealingStage, ...]
    """Rounds of descents, in order."""
    stop_confidence: float
    """Confidence of a refined pose that ends the search."""
    levelled: LevelledEffort | None = None
    """Search for levelled scenes that follows, if nothing is found; None if none does."""


QUICK = SearchLevel(
    rotations=384,
    source_points=64,
    target_points=256,
    cell_size=0.12,
    candidates=64,
    stages=(
        AnnealingStage(points=200, start_eps=0.15, end_eps=0.05, steps=6, keep=16),
        AnnealingStage(points=800, start_eps=0.06, end_eps=0.03, steps=6, keep=4),
        AnnealingStage(points=2000, start_eps=0.06, end_eps=0.02, steps=10, keep=4),
    ),
    stop_confidence=0.9,
    levelled=QUICK_LEVELLED,
)
THOROUGH = SearchLevel(
    rotations=1152,
    source_points=96,
    target_points=384,
    cell_size=0.12,
    candidates=128,
    stages=(
        AnnealingStage(points=200, start_eps=0.15, end_eps=0.05, steps=6, keep=16),
        AnnealingStage(points=1000, start_eps=0.06, end_eps=0.03, steps=8, keep=4),
        AnnealingStage(points=3000, start_eps=0.06, end_eps=0.02, steps=16, keep=4),
    ),
    stop_confidence=ACCEPTANCE_THRESHOLD,
)
WIDE = SearchLevel(
    rotations=4608,
    source_points=192,
    target_points=768,
    cell_size=0.1,
    candidates=1536,
    stages=(
        AnnealingStage(points=200, start_eps=0.12, end_eps=0.05, steps=6, keep=192),
        AnnealingStage(points=1000, start_eps=0.06, end_eps=0.03, steps=8, keep=64),
        AnnealingStage(points=2000, start_eps=0.06, end_eps=0.02, steps=10, keep=64),
    ),
    stop_confidence=ACCEPTANCE_THRESHOLD,
    levelled=THOROUGH_LEVELLED,
)
FINE = SearchLevel(
    rotations=4608,
    source_points=384,
    target_points=768,
    cell_size=0.07,
    candidates=3072,
    stages=(
        AnnealingStage(points=400, start_eps=0.09, end_eps=0.04, steps=6, keep=400),
        AnnealingStage(points=1000, start_eps=0.06, end_eps=0.03, steps=8, keep=128),
        AnnealingStage(points=2000, start_eps=0.06, end_eps=0.02, steps=10, keep=64),
    ),
    stop_confidence=ACCEPTANCE_THRESHOLD,
)
TURNED = replace(
    THOROUGH,
    rotations=23,
    candidates=23,
    stages=(replace(THOROUGH.stages[0], keep=12), replace(THOROUGH.stages[1], keep=6)),
)
"""Search among the turns of a box, which are given."""
SEARCH_LEVELS = (QUICK, THOROUGH, WIDE, FINE)
"""Levels in order: each follows where the one before finds no pose of its `stop_confidence`
(docs/tuning.md)."""


@dataclass(frozen=True, slots=True)
class Candidates:
    """Poses that a search found, best first."""

    poses: Poses
    """(K, 4, 4) T_target_source between the normalized clouds."""
    scores: NDArray[np.float32]
    """(K,) negative energy over the total weight, in [0, 1]."""


def find_poses(
    source: Surface,
    lattice: NearestLattice,
    level: SearchLevel,
    prior: PosePrior,
    seed: int,
    report: FractionCallback,
    rotations: Poses | None = None,
) -> Candidates:
    """Find local minima of the energy of `mpe_core.search`, lowest first.

    Parameters
    ----------
    source
        Surface that moves.
    lattice
        Nearest points of the surface that stays.
    level
        Effort of the search.
    prior
        Region of poses that is searched.
    seed
        Seed of the points that vote and descend.
    report
        Takes the fraction that is done.
    rotations
        (K, 3, 3) rotations to vote for; None for those of level and prior.
    """
    rng = np.random.default_rng(seed)
    if rotations is None:
        rotations = prior.rotations(level.rotations)
    poses = _vote(source, lattice.surface, level, rotations, prior, rng)
    report(0.5)
    order = rng.permutation(np.flatnonzero(source.weights > 0))
    min_eps = MIN_EPS_NOISES * max(source.roughness, lattice.surface.roughness)
    for k, stage in enumerate(level.stages):
        scores = _descend(poses, source, order[: stage.points], lattice, stage, min_eps)
        accepted = prior.accepts(poses)
        if accepted.any():
            poses, scores = poses[accepted], scores[accepted]
        kept = distinct_rows(poses, scores, stage.keep)
        kept = kept[scores[kept] >= PRUNE_BELOW * scores[kept[0]]]
        poses, scores = np.ascontiguousarray(poses[kept]), scores[kept]
        report(0.5 + 0.5 * (k + 1) / len(level.stages))
    return Candidates(poses, scores)


def _vote(
    source: Surface,
    target: Surface,
    level: SearchLevel,
    rotations: Poses,
    prior: PosePrior,
    rng: np.random.Generator,
) -> Poses:
    """(candidates, 4, 4) poses with the most votes, most first."""
    x = sample_spread_rows(source.points, source.weights, level.source_points, rng)
    y = sample_spread_rows(target.points, target.weights, level.target_points, rng)
    points, normals = source.points[x], source.normals[x]
    reach = np.abs(target.points[y]).max(axis=0) + np.linalg.norm(points, axis=1).max()
    cell = np.float32(max(level.cell_size, 2 * np.cbrt(np.prod(reach) / MAX_HISTOGRAM_CELLS)))
    half = np.ceil(reach / cell).astype(np.int64) + 2
    width = 2 * half + 1
    cells = np.floor(target.points[y] / cell).astype(np.int64)
    numbers = ((cells[:, 0] * width[1] + cells[:, 1]) * width[2] + cells[:, 2]).astype(np.int32)
    agree = np.abs(bin_directions() @ target.normals[y].T) > MIN_NORMAL_AGREEMENT
    starts = np.concatenate([[0], np.cumsum(agree.sum(axis=1))])
    translations, votes = best_translations(
        rotations.astype(np.float32),
        (points, normals),
        (numbers[np.nonzero(agree)[1]], starts),
        cell,
        half,
    )
    translations = prior.translations(translations)
    best = np.argsort(-votes, kind="stable")[: level.candidates]
    poses = np.tile(np.eye(4), (len(best), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotations[best], translations[best]
    return poses


def _descend(
    poses: Poses,
    source: Surface,
    rows: NDArray[np.int64],
    lattice: NearestLattice,
    stage: AnnealingStage,
    min_eps: float,
) -> NDArray[np.float32]:
    """Move the poses down the energy in place; returns their scores."""
    scores, target = np.empty(len(poses), np.float32), lattice.surface
    descend_poses(
        poses,
        scores,
        (source.points[rows], source.normals[rows], source.weights[rows]),
        (target.points, target.normals, target.weights),
        (lattice.rows, lattice.origin, lattice.cell),
        (
            np.float32(max(stage.start_eps, min_eps)),
            np.float32(max(stage.end_eps, min_eps)),
            stage.steps,
        ),
        np.float32(TANGENTIAL_WEIGHT),
        source.oriented and target.oriented,
    )
    return scores


def distinct_rows(poses: Poses, scores: NDArray[np.float32], count: int) -> NDArray[np.int64]:
    """Rows of up to `count` poses (K, 4, 4), best first, no two of which are close.

    Poses are close if they differ by less than MIN_APART_DEG and MIN_APART.
    """
    kept: list[int] = []
    rest = np.argsort(-scores, kind="stable")
    while len(rest) and len(kept) < count:
        kept.append(int(rest[0]))
        rest = rest[~are_close(poses[rest], poses[rest[0]])]
    return np.array(kept, np.int64)


def are_close(poses: Poses, T: Poses) -> NDArray[np.bool_]:
    """(K,) whether poses (K, 4, 4) are within MIN_APART_DEG and MIN_APART of T (4, 4)."""
    chord = 2 * np.sqrt(2) * np.sin(np.radians(MIN_APART_DEG) / 2)
    turned = np.square(poses[..., :3, :3] - T[:3, :3]).sum(axis=(-2, -1))
    shifted = np.square(poses[..., :3, 3] - T[:3, 3]).sum(axis=-1)
    close: NDArray[np.bool_] = (turned < chord**2) & (shifted < MIN_APART**2)
    return close


def bin_directions() -> NDArray[np.float32]:
    """(bins, 3) unit directions at the centres of `direction_bin`'s cells, in its order."""
    centre = (np.arange(BINS_PER_EDGE) + 0.5) / BINS_PER_EDGE * 2 - 1
    u, v = (g.ravel() for g in np.meshgrid(centre, centre, indexing="ij"))
    face = np.stack([np.ones_like(u), u, v], axis=1)
    directions = np.concatenate([np.roll(face, k, axis=1) for k in range(3)])
    unit: NDArray[np.float32] = directions / np.linalg.norm(directions, axis=1)[:, None]
    return unit.astype(np.float32)
