"""Evidence of flat clouds: their outlines have to lie on each other, all along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mpe_core.assess.coincidence import CoincidenceEvidence, doubt
from mpe_core.assess.confidence import Evidence
from mpe_core.clouds.flat import Outline, Plane
from mpe_core.geometry.rigid import apply

Array = NDArray[np.float64]

MIN_ON_OUTLINE = 0.9
"""Share of the points on the outline, either way, from which on a pose is right; different closed
curves come to half."""

STEEPNESS = 60.0
"""How much the log odds grow with that share."""


def keep_level(
    coincidences: list[tuple[Array, CoincidenceEvidence]], source: Plane, target: Plane
) -> list[tuple[Array, CoincidenceEvidence]]:
    """Keep the poses that do not turn clouds of two dimensions over."""
    if not (source.is_level and target.is_level):
        return coincidences
    return [(T, evidence) for T, evidence in coincidences if T[2, 2] > 0]


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
