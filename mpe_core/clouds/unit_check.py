"""Detection of clouds in different units of length."""

from __future__ import annotations

import numpy as np

UNIT_FACTORS = {
    25.4: "millimetres and inches",
    39.37: "inches and metres",
    100.0: "centimetres and metres",
    304.8: "millimetres and feet",
    1000.0: "millimetres and metres",
}
"""Factors between common units of length."""

SIZE_TOL = 1.5
"""Factor by which scans of one thing may differ in size."""


def describe_unit_mismatch(source_radius: float, target_radius: float) -> str | None:
    """Say which units the clouds of these radii may be in; None if their ratio suits none.

    Scale is not estimated, so that a registration of clouds in different units fails.
    """
    ratio = target_radius / source_radius
    size = max(ratio, 1 / ratio)
    factor = min(UNIT_FACTORS, key=lambda known: abs(np.log(size / known)))
    if not factor / SIZE_TOL <= size <= factor * SIZE_TOL:
        return None
    larger, smaller = ("target", "source") if ratio > 1 else ("source", "target")
    return (
        f"the {larger} is {size:.4g} times as large as the {smaller}: are they in"
        f" {UNIT_FACTORS[factor]} (a factor of {factor:g})? Scale is not estimated: convert both"
        " clouds to one unit"
    )
