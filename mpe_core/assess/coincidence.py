"""How likely chance lays few points on each other: the evidence for markers and trees."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpe_core.assess.confidence import Evidence
from mpe_core.search.congruence import (
    MAX_POINTS,
    MIN_POINTS,
    TOLERANCES,
    Coincidence,
    CongruenceSearch,
)

Array = NDArray[np.float64]

FALSE_ALARMS_TO_ODDS = 1e3
"""Odds of wrong over right for each expected false alarm: at a thousandth, both are as likely."""

MIN_ERROR = 1e-5
"""Smallest error of a point that counts, in spacings: equal numbers are no infinite evidence."""

EQUAL_SHARE = 0.95
"""Share of the best pose's matches from which on another one fits as well."""

MAX_FOR_COARSE = 300
"""Points up to which coarse tolerances are tried: unlike sets of more take minutes."""

MIN_FOR_DIMENSION = 150
"""Points that it takes to tell a surface from scattered points."""

SURFACE_DIMENSION = 2.35
"""Dimension of the points above which they are no surface: those of a thousand random points in a
cube come to 2.6."""


@dataclass(frozen=True, slots=True)
class CoincidenceEvidence(Evidence):
    """Evidence of points that correspond one by one."""

    log_false_alarms: float = 0.0
    """Natural logarithm of the number of poses that fit as well by chance."""
    reach: float = 0.0
    """Distance up to which points correspond, in the unit of the points."""

    @property
    def confidence(self) -> float:
        """Probability that the pose is right, in [0, 1]."""
        exponent = np.clip(self.log_false_alarms + np.log(FALSE_ALARMS_TO_ODDS), -700, 700)
        return float(1 / (1 + np.exp(exponent)))


def weigh_coincidence(found: Coincidence, spacing: float, dimension: float) -> CoincidenceEvidence:
    """Count the poses that would lay as many points as near by chance.

    The number of triples of points that can define a pose, times the binomial probability of the
    other matches; at the distance at which that is least (Moisan and Stival 2004).

    Parameters
    ----------
    found
        Pose with the distances of its points.
    spacing
        Distance between neighbouring points.
    dimension
        Dimension of the points, from 1 for a curve to 3 for a volume.
    """
    distances = np.sort(found.distances)
    n = len(distances)
    matches = np.arange(1, n + 1)
    chance = np.pi * (np.maximum(distances / spacing, MIN_ERROR)) ** np.clip(dimension - 0.5, 1, 2)
    tails = _log_binomial_tails(n - 3, matches - 3, np.minimum(chance, 1.0))
    tests = 6 * np.log(n) - np.log(6) + np.log(n)
    usable = matches >= MIN_POINTS
    best = int(np.argmin(np.where(usable, tails, np.inf)))
    share = (best + 1) / n
    return CoincidenceEvidence(
        coverage=share,
        on_surface_fraction=share,
        surface_agreement=share,
        log_false_alarms=float(tests + tails[best]),
        reach=float(distances[best]),
    )


def find_coincidences(
    source: Array, target: Array, seed: int
) -> list[tuple[Array, CoincidenceEvidence]] | None:
    """Find the poses (4, 4) at which points correspond one by one, with the best evidence first.

    Poses that fit as well follow. None if there are too many or too few points to ask.

    Parameters
    ----------
    source, target
        (N, 3) and (M, 3) points.
    seed
        Seed of the random choices.
    """
    fewest, most = sorted((len(source), len(target)))
    if fewest < MIN_POINTS or most > MAX_POINTS:
        return None
    search = CongruenceSearch(source, target, seed)
    if search.spacing == 0:
        return None
    dimension = estimate_dimension(target)
    is_surface = len(target) >= MIN_FOR_DIMENSION and dimension <= SURFACE_DIMENSION
    # another sample of a surface has no equal points: only exact ones are asked for
    tolerances = TOLERANCES[: 1 if is_surface else 2 if most > MAX_FOR_COARSE else 3]
    weighed: list[tuple[Coincidence, CoincidenceEvidence]] = []
    for tolerance in tolerances:
        found = search.find(tolerance * search.spacing)
        weighed += [(each, weigh_coincidence(each, search.spacing, dimension)) for each in found]
        if any(evidence.accepted for _, evidence in weighed):
            break
    weighed.sort(key=lambda pair: pair[1].log_false_alarms)
    enough = [pair for pair in weighed if pair[0].count >= EQUAL_SHARE * weighed[0][0].count]
    return [(found.T, evidence) for found, evidence in enough]


def estimate_dimension(points: Array) -> float:
    """Estimate from how the number of neighbours grows with the distance; 2 for few points."""
    if len(points) < MIN_FOR_DIMENSION:
        return 2.0
    square = np.zeros((len(points), len(points)))
    for axis in range(3):
        square += np.square(points[:, None, axis] - points[None, :, axis])
    np.fill_diagonal(square, np.inf)
    radius = 2 * np.median(np.sqrt(square.min(axis=1)))
    near, far = (max(1, int((square < (radius * k) ** 2).sum())) for k in (1, 2))
    return float(np.log2(far / near))


def are_scattered(points: Array) -> bool:
    """Whether points (N, 3) are too few, or too scattered, to show a surface."""
    return len(points) < MIN_FOR_DIMENSION or estimate_dimension(points) > SURFACE_DIMENSION


def doubt(evidence: Evidence, log_false_alarms: float) -> CoincidenceEvidence:
    """Return the evidence of a pose whose points do not correspond one by one."""
    fields = {name: getattr(evidence, name) for name in Evidence.__dataclass_fields__}
    return replace(CoincidenceEvidence(**fields), log_false_alarms=log_false_alarms)


def _log_binomial_tails(n: int, k: NDArray[np.int64], p: Array) -> Array:
    """Bound log P(at least k of n) for the probabilities p, by Chernoff; 0 where k is expected."""
    share = np.clip(k / max(n, 1), 0.0, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        one = np.where(share > 0, share * np.log(share / p), 0.0)
        other = np.where(share < 1, (1 - share) * np.log((1 - share) / (1 - p)), 0.0)
    bound: Array = np.where(share > p, -n * (one + other), 0.0)
    return bound
