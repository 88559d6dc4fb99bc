"""Units of length that two clouds of unlike size may be in."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np

METRES = {
    "millimetres": 1e-3,
    "centimetres": 1e-2,
    "inches": 0.0254,
    "feet": 0.3048,
    "metres": 1.0,
    "kilometres": 1e3,
}
"""Units in metres. The US survey foot is two parts in a million longer than the foot."""

SIZE_TOL = 1.6
"""Factor by which scans of one thing may differ in size."""

MAX_GUESSES = 3
"""Factors that are tried, the nearest to the ratio of the sizes first."""


@dataclass(frozen=True, slots=True)
class UnitChange:
    """Units of both clouds, and the factor between them."""

    source: str
    """Unit of the source."""
    target: str
    """Unit of the target."""
    factor: float
    """What turns lengths of the source into those of the target."""


def guess_units(source_radius: float, target_radius: float) -> list[UnitChange]:
    """Guess the units of clouds with these radii, the likeliest first; none where one unit suits.

    Of pairs with one factor, millimetres and metres or metres and kilometres, the first is named.
    """
    ratio = target_radius / source_radius
    guesses: dict[float, UnitChange] = {}
    for source, target in permutations(METRES, 2):
        factor = METRES[source] / METRES[target]
        if max(ratio / factor, factor / ratio) <= SIZE_TOL:
            guesses.setdefault(round(float(np.log(factor)), 3), UnitChange(source, target, factor))
    ordered = sorted(guesses.values(), key=lambda guess: abs(np.log(ratio / guess.factor)))
    return ordered[:MAX_GUESSES]
