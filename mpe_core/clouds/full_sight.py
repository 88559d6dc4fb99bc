"""Place from which a scan hides nothing of itself: as good as the scanner's to tell free space.

A scanner sees no point behind another. So seen from where it stood no point of its scan hides
another, and the ways from there to the points are free; from nearly everywhere else many points are
hidden. Where nobody tells that place and the points are in no order, a place from which hardly any
point is hidden stands for it: whether or not the scanner stood there, nothing that the scan shows
lies in the ways from there to its points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.ground import Ground
from mpe_core.clouds.normalize import robust_radius
from mpe_core.clouds.surface import Surface
from mpe_core.geometry.rigid import rotation_between
from mpe_core.kernels.hidden_points import hidden_shares

Array = NDArray[np.float64]

MAX_HIDDEN = 0.03
"""Share of the points that may be hidden from the place: noise and edges hide some."""

MAX_HIDDEN_RATIO = 0.4
"""The same over the median of the places around."""

MIN_USUALLY_HIDDEN = 0.06
"""Least such median: where most places see nearly all, none of them tells much (docs/tuning.md)."""

MIN_SEEN = 0.06
"""Share of the directions in which points lie, from which on a place is among them: from outside,
few points hide others, too."""

SEEN_WEIGHT = 0.2
"""Weight of the seen directions against the hidden points: of places that hide as little, the one
in the midst of the points is looked for (docs/tuning.md)."""

REACH, STEP = 0.3, 0.1
"""Largest distance from the median of the points along the ground, and between the places that are
tried first, in radii: with dense noise-free scans the share rises within a tenth of the place."""

HEIGHTS, MAX_HEIGHT = (0.03, 0.08, 0.15), 0.2
"""Heights over the ground of these places, and of any place: from high above a street most points
are seen, and nothing is told (docs/tuning.md)."""

FINER_STEPS = ((0.05, 8), (0.025, 4), (0.0125, 2))
"""Steps to the 26 places around the best ones that are left, and how many these are."""

COARSE_POINTS, COARSE_EDGE = 1500, 24
"""Points, and cells along a quarter of a turn, that the places are compared by at first."""

FINE_POINTS, FINE_EDGE = 3000, 30
"""The same for the steps."""

RANGE_MARGIN, MARGIN, SLOPE = 0.08, 0.015, 0.05
"""Nearer points hide others from this share of the range and this length in radii on, see
`hidden_shares`."""

AROUND = np.stack(np.meshgrid(*[np.arange(-1.0, 2.0)] * 3), axis=-1).reshape(-1, 3)
"""(27, 3) steps along the axes, none among them."""


@dataclass(frozen=True, slots=True)
class FullSight:
    """Place from which hardly any point is hidden."""

    place: Array
    """(3,) in the frame of the cloud."""
    certainty: float
    """Share of the points that are not hidden from there."""


def find_full_sight(surface: Surface, ground: Ground) -> FullSight | None:
    """Find the place over the ground amid the points from which the fewest are hidden.

    Minimises the share of hidden points less SEEN_WEIGHT times that of the directions with points.

    Returns
    -------
    FullSight or None
        None where more than a few are hidden from everywhere, or few from anywhere.
    """
    is_fitted = np.abs(surface.normals).max(axis=1, initial=0) > 0
    points, normals = (
        each[is_fitted].astype(np.float64) for each in (surface.points, surface.normals)
    )
    if len(points) < COARSE_POINTS:
        return None
    middle = np.median(points, axis=0)
    radius = robust_radius(points, middle)
    R = rotation_between(ground.up, np.array([0.0, 0.0, 1.0]))
    middle += (ground.height - middle @ ground.up) * ground.up  # on the ground
    x, normals = (points - middle) @ R.T / radius, normals @ R.T
    drawn = np.random.default_rng(0).permutation(len(x))
    few, many = (
        (x[drawn[:count]], normals[drawn[:count]], edge)
        for count, edge in ((COARSE_POINTS, COARSE_EDGE), (FINE_POINTS, FINE_EDGE))
    )
    grid = np.arange(-REACH, REACH + STEP / 2, STEP)
    places = np.stack(np.meshgrid(grid, grid, HEIGHTS), axis=-1).reshape(-1, 3)
    hidden, seen = _look(places, few)
    usual = float(np.median(hidden))
    if usual < MIN_USUALLY_HIDDEN:
        return None
    order = np.argsort(hidden - SEEN_WEIGHT * seen, kind="stable")
    for step, count in FINER_STEPS:
        places = _step(places[order[:count]], step, many)
        hidden, seen = _look(places, many)
        order = np.argsort(hidden - SEEN_WEIGHT * seen, kind="stable")
    best = order[0]
    is_certain = hidden[best] <= min(MAX_HIDDEN, MAX_HIDDEN_RATIO * usual)
    if not is_certain or seen[best] < MIN_SEEN:
        return None
    return FullSight(middle + radius * places[best] @ R, 1 - float(hidden[best]))


def _look(places: Array, cloud: tuple[Array, Array, int]) -> tuple[Array, Array]:
    """Shares (P,) of hidden points and seen directions at the places (P, 3)."""
    points, normals, edge = cloud
    hidden, seen = hidden_shares(places, points, normals, edge, RANGE_MARGIN, MARGIN, SLOPE)
    return hidden, seen


def _step(places: Array, step: float, cloud: tuple[Array, Array, int]) -> Array:
    """Best of the places around each of the places (P, 3), without those that have met."""
    around = (places[:, None] + step * AROUND).reshape(-1, 3)
    around[:, 2] = np.clip(around[:, 2], 0, MAX_HEIGHT)
    hidden, seen = _look(around, cloud)
    best = (hidden - SEEN_WEIGHT * seen).reshape(len(places), -1).argmin(axis=1)
    return np.unique(around.reshape(len(places), -1, 3)[np.arange(len(places)), best], axis=0)
