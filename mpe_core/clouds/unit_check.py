"""Clouds whose sizes differ as their units do."""

from __future__ import annotations

import numpy as np

FACTORS = {
    25.4: "millimetres and inches",
    39.37: "inches and metres",
    100.0: "centimetres and metres",
    304.8: "millimetres and feet",
    1000.0: "millimetres and metres",
}
SLACK = 1.5
"""Scans of one thing differ in size by up to this factor."""


def unit_mismatch(source_radius: float, target_radius: float) -> str | None:
    """What is likely wrong when clouds of these radii do not fit: their units; None if nothing is.

    Scale is not estimated: a registration of such clouds fails.
    """
    ratio = target_radius / source_radius
    size = max(ratio, 1 / ratio)
    factor = min(FACTORS, key=lambda known: abs(np.log(size / known)))
    if not factor / SLACK <= size <= factor * SLACK:
        return None
    larger, smaller = ("target", "source") if ratio > 1 else ("source", "target")
    return (
        f"the {larger} is {size:.4g} times as large as the {smaller}: are they in"
        f" {FACTORS[factor]} (a factor of {factor:g})? Scale is not estimated: bring both to one"
        " unit"
    )
