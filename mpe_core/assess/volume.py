"""Evidence of clouds that fill a volume: they fit nearly everywhere, only exact points count."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mpe_core.assess.coincidence import CoincidenceEvidence, doubt, weigh_coincidence
from mpe_core.assess.confidence import Evidence
from mpe_core.geometry.cell_list import CellList, Points
from mpe_core.geometry.rigid import axis_rotation
from mpe_core.geometry.sampling import take_every
from mpe_core.search.neighbour_patterns import match_patterns

Array = NDArray[np.float64]

RADII, MIN_NEIGHBOURS, SUBSET_POINTS = (0.065, 0.127, 0.18, 0.25, 0.35), 12, 1500
"""Radii of the neighbourhoods, fewest points of one at the median, and their number."""

MIN_VARIATION = 0.1
"""Median surface variation, at the radius where it is least, from which on a cloud may fill a
volume; noise of 0.04 on a surface comes to 0.08 (docs/tuning.md)."""

DISPLACEMENT, DISPLACED_POSES = 0.2, 12
"""Turn in radians and shift in radii of poses beside the found one, and their number."""

MAX_LEFT, STEEPNESS = 0.56, 40.0
"""Share of the points on the surface that such poses keep, at the median, up to which the pose
counts, and how much the log odds fall with it; volumes keep 0.6 and more (docs/tuning.md)."""

MAX_PATTERN_POINTS = 50_000
"""Points of a cloud up to which correspondence one by one is asked for: more take seconds."""


def may_fill_volume(points: Points) -> bool:
    """Whether no neighbourhood size shows a surface.

    Parameters
    ----------
    points
        (N, 3) coarse points in radii of the cloud.
    """
    subset, least = take_every(points, SUBSET_POINTS), np.inf
    for radius in RADII:
        planes = CellList(points, radius).planes(subset)
        if np.median(planes.counts) >= MIN_NEIGHBOURS:
            least = min(least, float(np.median(planes.surface_variation)))
    return MIN_VARIATION < least < np.inf


def find_exact_pose(
    source: Array, target: Array, seed: int
) -> tuple[Array, CoincidenceEvidence] | None:
    """Find the pose (4, 4) of volumes that correspond point by point; None if they do not.

    Parameters
    ----------
    source, target
        (N, 3) and (M, 3) points.
    seed
        Seed of the random choices.
    """
    if max(len(source), len(target)) > MAX_PATTERN_POINTS:
        return None
    found, spacing = match_patterns(source, target, seed)
    if spacing == 0:
        return None
    evidence = weigh_coincidence(found, spacing, dimension=3.0)
    return (found.T, evidence) if evidence.accepted else None


def doubt_fit_everywhere(
    evidence: Evidence, T: Array, centre: Array, score: Callable[[Array], Evidence]
) -> Evidence:
    """Lower the confidence in a pose beside which the clouds fit nearly as well.

    Parameters
    ----------
    evidence
        Evidence of the pose.
    T
        (4, 4) pose.
    centre
        (3,) centre of the moved source.
    score
        Measures the evidence of a pose.
    """
    left = [score(D @ T).on_surface_fraction for D in _displacements(centre)]
    share = float(np.median(left)) / max(evidence.on_surface_fraction, 1e-9)
    if share <= MAX_LEFT:
        return evidence
    doubted = doubt(evidence, STEEPNESS * (share - MAX_LEFT) - np.log(1e3))
    return doubted if doubted.confidence < evidence.confidence else evidence


def _displacements(centre: Array) -> list[Array]:
    rng, found = np.random.default_rng(0), []
    for _ in range(DISPLACED_POSES):
        axis, shift = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        D = np.eye(4)
        D[:3, :3] = axis_rotation(axis, DISPLACEMENT)
        D[:3, 3] = centre - np.einsum("ij,j->i", D[:3, :3], centre) + DISPLACEMENT * shift
        found.append(D)
    return found
