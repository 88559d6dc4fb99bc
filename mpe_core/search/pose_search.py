"""The search over SO(3) x R^3: votes for translations, then waves of descents on the P2 energy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.surface import Surface
from mpe_core.geometry.sampling import sample_spread_rows
from mpe_core.kernels.energy_descent import descend_poses
from mpe_core.kernels.translation_votes import BINS_PER_EDGE, best_translations
from mpe_core.options import ACCEPTANCE_THRESHOLD
from mpe_core.search.nearest_lattice import NearestLattice
from mpe_core.search.pose_prior import PosePrior

Poses = NDArray[np.float64]

AGREEMENT = 0.75
"""|n.c| from which on a target point votes in the direction bin around c: 41 degrees. Rank of the
first good candidate over the 85 shared pairs, 2,304 rotations, median / 90 % / 95 %: without
normals 0 / 11 / 49, with them 0 / 2 / 7."""

SLIDE = 0.02
"""Weight of the tangential residual beside the normal one. Starts 10-15 degrees off, error after 6
steps, median: 1 (point to point) 4.2 degrees, 0.3 1.8, 0.1 0.5, 0.03 0.2. Walls hold a pose back
with it: the facade pair 6-5 stays 1.4 m off with 0.05."""

HOPELESS = 0.4
"""Candidates that score less than this share of the best go down no further. The five hardest
shared pairs, four starts each: 20 of 20 right with it and without; the waves of an easy pair take a
quarter of the time."""

APART_DEGREES, APART = 8.0, 0.1
"""Poses closer than both are one candidate."""


MOST_HISTOGRAM_CELLS = 300_000
"""Bound on a histogram of votes, 0.6 MB; a target much larger than the source gets larger cells."""


@dataclass(frozen=True, slots=True)
class AnnealingStage:
    """One round of descents: how many points, from which eps to which, how many steps, how many
    stay."""

    points: int
    start: float
    end: float
    steps: int
    keep: int


@dataclass(frozen=True, slots=True)
class SearchLevel:
    """How widely to search. Lengths in radii of the smaller cloud."""

    rotations: int
    source_points: int
    target_points: int
    cell: float
    candidates: int
    waves: tuple[AnnealingStage, ...]
    enough: float
    """Confidence of a pose that ends the search."""


QUICK = SearchLevel(
    rotations=384,
    source_points=64,
    target_points=256,
    cell=0.12,
    candidates=64,
    waves=(
        AnnealingStage(200, 0.15, 0.05, 6, 16),
        AnnealingStage(800, 0.06, 0.03, 6, 4),
        AnnealingStage(2000, 0.06, 0.02, 10, 4),
    ),
    enough=0.9,
)
THOROUGH = SearchLevel(
    rotations=1152,
    source_points=96,
    target_points=384,
    cell=0.12,
    candidates=128,
    waves=(
        AnnealingStage(200, 0.15, 0.05, 6, 16),
        AnnealingStage(1000, 0.06, 0.03, 8, 4),
        AnnealingStage(3000, 0.06, 0.02, 16, 4),
    ),
    enough=ACCEPTANCE_THRESHOLD,
)
WIDE = SearchLevel(
    rotations=4608,
    source_points=192,
    target_points=768,
    cell=0.1,
    candidates=1536,
    waves=(
        AnnealingStage(200, 0.12, 0.05, 6, 192),
        AnnealingStage(1000, 0.06, 0.03, 8, 64),
        AnnealingStage(2000, 0.06, 0.02, 10, 64),
    ),
    enough=ACCEPTANCE_THRESHOLD,
)
SEARCH_LEVELS = (QUICK, THOROUGH, WIDE)
"""Each follows where the one before does not find enough. The 85 shared pairs, two starts each, and
130 composed from them: quick alone is right in 293 of 300, and of its 270 poses of confidence 0.9
and more none is wrong; with 0.5 instead, one that slides along a street stayed. 288 rotations 292,
576 rotations and 96 candidates 293. Thorough alone finds 84 shared pairs, wide all. Of 42 composed
pairs that overlap by 0.15 to 0.3 wide finds 26, and 22 / 25 / 27 with 8 / 48 / 96 kept instead of
64, in 0.8 / 0.9 / 1.1 times its time."""


@dataclass(frozen=True, slots=True)
class Candidates:
    """Poses found, best first, and their scores in [0, 1]."""

    poses: Poses
    """(K, 4, 4) T_target_source between the centred, scaled clouds."""
    scores: NDArray[np.float32]


def find_poses(
    source: Surface,
    field: NearestLattice,
    effort: SearchLevel,
    knowledge: PosePrior,
    seed: int,
    report: Callable[[float], None],
) -> Candidates:
    """Local minima of the P2 energy, lowest first, from every rotation and translation that the
    knowledge allows.

    Minimises -sum_i K_i |n_i.n_j*|^2 eps^2 / (|y_j* - (R x_i + t)|^2 + eps^2), the P2 criterion
    (Eq. 10) with the paper's weights K_i and the agreement of normals: of either sign, or of one
    where both surfaces know their outside.
    """
    rng = np.random.default_rng(seed)
    poses = _vote(source, field.surface, effort, knowledge, rng)
    report(0.5)
    order = rng.permutation(np.flatnonzero(source.weights > 0))
    # below the noise there is nothing to descend to
    least_eps = 1.5 * max(source.roughness, field.surface.roughness)
    for k, wave in enumerate(effort.waves):
        scores = _descend(poses, source, order[: wave.points], field, wave, least_eps)
        allowed = knowledge.allows(poses)
        if allowed.any():
            poses, scores = poses[allowed], scores[allowed]
        kept = distinct(poses, scores, wave.keep)
        kept = kept[scores[kept] >= HOPELESS * scores[kept[0]]]
        poses, scores = np.ascontiguousarray(poses[kept]), scores[kept]
        report(0.5 + 0.5 * (k + 1) / len(effort.waves))
    return Candidates(poses, scores)


def _vote(
    source: Surface,
    target: Surface,
    effort: SearchLevel,
    knowledge: PosePrior,
    rng: np.random.Generator,
) -> Poses:
    """(candidates, 4, 4) poses with the most votes, most first."""
    x = sample_spread_rows(source.points, source.weights, effort.source_points, rng)
    y = sample_spread_rows(target.points, target.weights, effort.target_points, rng)
    points, normals = source.points[x], source.normals[x]
    reach = np.abs(target.points[y]).max(axis=0) + np.linalg.norm(points, axis=1).max()
    cell = np.float32(max(effort.cell, 2 * np.cbrt(np.prod(reach) / MOST_HISTOGRAM_CELLS)))
    half = np.ceil(reach / cell).astype(np.int64) + 2
    width = 2 * half + 1
    cells = np.floor(target.points[y] / cell).astype(np.int64)
    numbers = ((cells[:, 0] * width[1] + cells[:, 1]) * width[2] + cells[:, 2]).astype(np.int32)
    agree = np.abs(bin_directions() @ target.normals[y].T) > AGREEMENT
    starts = np.concatenate([[0], np.cumsum(agree.sum(axis=1))])
    rotations = knowledge.rotations(effort.rotations)
    translations, votes = best_translations(
        rotations.astype(np.float32),
        (points, normals),
        (numbers[np.nonzero(agree)[1]], starts),
        cell,
        half,
    )
    translations = knowledge.translations(translations)
    best = np.argsort(-votes, kind="stable")[: effort.candidates]
    poses = np.tile(np.eye(4), (len(best), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotations[best], translations[best]
    return poses


def _descend(
    poses: Poses,
    source: Surface,
    rows: NDArray[np.int64],
    field: NearestLattice,
    wave: AnnealingStage,
    least_eps: float,
) -> NDArray[np.float32]:
    """Move the poses down the energy in place; their scores."""
    scores, target = np.empty(len(poses), np.float32), field.surface
    descend_poses(
        poses,
        scores,
        (source.points[rows], source.normals[rows], source.weights[rows]),
        (target.points, target.normals, target.weights),
        (field.rows, field.origin, field.cell),
        (
            np.float32(max(wave.start, least_eps)),
            np.float32(max(wave.end, least_eps)),
            wave.steps,
        ),
        np.float32(SLIDE),
        source.oriented and target.oriented,
    )
    return scores


def distinct(poses: Poses, scores: NDArray[np.float32], most: int) -> NDArray[np.int64]:
    """Rows of up to `most` poses, best first, no two of them closer than APART_DEGREES and
    APART."""
    chord = 2 * np.sqrt(2) * np.sin(np.radians(APART_DEGREES) / 2)
    kept: list[int] = []
    for row in np.argsort(-scores, kind="stable"):
        near = np.linalg.norm(poses[kept, :3, :3] - poses[row, :3, :3], axis=(1, 2)) < chord
        near &= np.linalg.norm(poses[kept, :3, 3] - poses[row, :3, 3], axis=1) < APART
        if not near.any():
            kept.append(int(row))
        if len(kept) == most:
            break
    return np.array(kept)


def bin_directions() -> NDArray[np.float32]:
    """(bins, 3) unit directions at the centres of `direction_bin`'s cells, in its order."""
    centre = (np.arange(BINS_PER_EDGE) + 0.5) / BINS_PER_EDGE * 2 - 1
    u, v = (g.ravel() for g in np.meshgrid(centre, centre, indexing="ij"))
    face = np.stack([np.ones_like(u), u, v], axis=1)
    directions = np.concatenate([np.roll(face, k, axis=1) for k in range(3)])
    unit: NDArray[np.float32] = directions / np.linalg.norm(directions, axis=1)[:, None]
    return unit.astype(np.float32)
