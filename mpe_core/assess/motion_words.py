"""Motions between poses in words: along which surfaces slide, and by which a scene repeats."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mpe_core.geometry.rigid import apply, inverse
from mpe_core.refine.covariance import MIN_TURN_SHARE

Array = NDArray[np.float64]

MAX_OFF_AXIS_DEG = 8.0
"""Angle from an axis up to which a direction is called by the name of the axis."""

MIN_TURN_DEG = 5.0
"""Turn between two poses from which on they are said to be turned rather than shifted."""


def describe_free_directions(directions: Array) -> str:
    """Say which motions the directions (K, 6) span: slides first, then turns.

    The directions themselves are any basis: of a plane, each may be a slide with a turn in it.

    Parameters
    ----------
    directions
        (K, 6) rotation vectors and translations, both of about unit length for unit motions.
    """
    combination, size, axes = np.linalg.svd(directions[:, :3])
    turning = int((size > MIN_TURN_SHARE).sum())
    slides = np.linalg.svd(combination[:, turning:].T @ directions[:, 3:])[2]
    words = (
        _say("slides", len(directions) - turning, slides, ("along", "across", "in any direction")),
        _say("turns", turning, axes, ("about", "about axes across", "about any axis")),
    )
    return " and ".join(each for each in words if each)


def _say(verb: str, count: int, basis: Array, words: tuple[str, str, str]) -> str:
    """Describe motions along the first `count` rows of an orthogonal basis (3, 3)."""
    one, two, three = words
    if count == 0:
        return ""
    if count == 1:
        return f"{verb} {one} {name_direction(basis[0])}"
    return f"{verb} {two} {name_direction(basis[2])}" if count == 2 else f"{verb} {three}"


def describe_alternatives(T: Array, alternatives: Array, centre: Array) -> str:
    """Say how the alternatives (K, 4, 4) differ from the pose T (4, 4), the nearest first.

    Parameters
    ----------
    T, alternatives
        T_target_source of the result and of the others.
    centre
        (3,) centre of the source.
    """
    moved = apply(T, centre[None])[0]
    turned, shifted = [], []
    for other in alternatives:
        motion = other @ inverse(T)
        turn = Rotation.from_matrix(motion[:3, :3]).as_rotvec(degrees=True)
        shift = apply(motion, moved[None])[0] - moved
        if np.linalg.norm(turn) >= MIN_TURN_DEG:
            turned.append(turn)
        else:
            shifted.append(shift)
    words = []
    if shifted:
        step = min(shifted, key=lambda each: float(np.linalg.norm(each)))
        words.append(f"shifted by {np.linalg.norm(step):.4g} along {name_direction(step)}")
    if turned:
        turn = min(turned, key=lambda each: float(np.linalg.norm(each)))
        words.append(f"turned by {np.linalg.norm(turn):.0f} degrees about {name_direction(turn)}")
    return " or ".join(words)


def name_direction(direction: Array) -> str:
    """Name the axis that a direction (3,) lies along, or give its components; of either sign."""
    unit = direction / max(float(np.linalg.norm(direction)), 1e-300)
    largest = int(np.argmax(np.abs(unit)))
    unit = unit * np.sign(unit[largest]) + 0.0
    if unit[largest] >= np.cos(np.radians(MAX_OFF_AXIS_DEG)):
        return "xyz"[largest]
    return "({})".format(", ".join(f"{value:.2f}" for value in unit.round(2) + 0.0))
