"""Evidence of flat clouds: their outlines have to lie on each other, all along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mpe_core.assess.coincidence import CoincidenceEvidence, doubt
from mpe_core.assess.confidence import Evidence
from mpe_core.clouds.flat import Outline, Plane
from mpe_core.geometry.rigid import apply, axis_rotation, pose

Array = NDArray[np.float64]

MIN_ON_OUTLINE = 0.9
"""Share of the points on the outline, either way, from which on a pose is right; different closed
curves come to half."""

TURNS_DEG = (45, 60, 90, 120, 135, 180, 225, 240, 270, 300, 315)
"""Turns by which outlines fit on themselves: rectangles, triangles, squares, hexagons, octagons."""

STEEPNESS = 60.0
"""How much the log odds grow with that share."""


def keep_level(
    coincidences: list[tuple[Array, CoincidenceEvidence]], source: Plane, target: Plane
) -> list[tuple[Array, CoincidenceEvidence]]:
    """Keep the poses that do not turn clouds of two dimensions over."""
    if not (source.is_level and target.is_level):
        return coincidences
    return [(T, evidence) for T, evidence in coincidences if T[2, 2] > 0]


def turn_outline(source: Outline, T: Array) -> list[Array]:
    """Poses (4, 4) that turn the source about its middle before T (4, 4): it may fit so as well."""
    middle, up = source.points.mean(axis=0), np.array([0.0, 0.0, 1.0])
    rotations = [axis_rotation(up, np.radians(degrees)) for degrees in TURNS_DEG]
    return [T @ pose(R, middle - R @ middle) for R in rotations]


def weigh_outline(
    evidence: Evidence, T: Array, source: Outline, target: Outline
) -> CoincidenceEvidence:
    """Weigh a pose by the share of the points on the other outline, the larger of both ways.

    Parameters
    ----------
    evidence
        Evidence of the walls over the outlines.
    T
        (4, 4) pose between the frames of the planes.
    source, target
        Outlines.
    """
    reach, moved = max(source.error, target.error), apply(T, source.points)
    shares = [
        float(np.mean(cKDTree(there).query(here, distance_upper_bound=reach)[0] < np.inf))
        for here, there in ((moved, target.points), (target.points, moved))
    ]
    doubted = doubt(evidence, -STEEPNESS * (max(shares) - MIN_ON_OUTLINE) - np.log(1e3))
    return replace(doubted, reach=reach)
