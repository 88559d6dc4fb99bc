"""Viewpoint of the scanner, told from the order in which a scan lists its points.

A scanner turns its beam, and a camera reads its pixels, by equal steps. Seen from where it stood,
points that follow one another therefore lie at equal steps of the direction, across every edge of
depth; seen from elsewhere they do not. Clouds that were shuffled, thinned or merged tell nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.distances import distances_from
from mpe_core.geometry.sampling import take_every
from mpe_core.kernels.equal_steps import step_equations, step_lengths, unequal_steps

Array = NDArray[np.float64]

USUAL_POINTS = 2000
"""Points, or up to twice as many, that middle and radius of the cloud are taken from, and steps
that tell their usual length."""

RUNS, MAX_RUN = 8, 8192
"""Runs of points that are looked at, and their length."""

MIN_BEND = 0.15
"""Difference of two steps in space over their mean from which on they tell of the place: on smooth
surfaces all steps look equal from anywhere."""

MAX_STEP = 0.05
"""Median distance of points that follow one another, in radii of the cloud, up to which they are in
an order; clouds in no order have 0.06 to 0.9 (docs/tuning.md)."""

MIN_TRIPLES, MAX_TRIPLES = 200, 400
"""Triples of points that are needed, and that are looked at."""

START_TRIPLES, COARSE_TRIPLES = 30, 100
"""Triples that sift the starts, and that the first steps look at."""

NEAR_STARTS = ((0.15, 1), (0.4, 4))
"""Starts around the middle of the cloud: distance in radii, and number on either side along an
axis. From half that distance off the search ends at the place (docs/tuning.md)."""

FAR_STARTS = (2.2, 3.0, 4.2, 5.8)
"""Distances of the starts around the cloud, in radii, each in 98 directions."""

SIFTED_STARTS, DESCENDED_STARTS = 40, 6
"""Starts that are compared by more triples, and from which the place is refined."""

COARSE_SCALES, FINE_SCALES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.18), (0.12, 0.08, 0.05, 0.05, 0.05)
"""Scale of the loss in each step, from wide enough for a start on the way to that of the noise."""

EQUAL_STEP_TOL = 0.1
"""Difference of two steps of the direction over their mean up to which they are equal."""

MIN_CERTAINTY = 0.4
"""Share of equal steps from which on the place is certain (docs/tuning.md)."""

MAX_DISTANCE = 8.0
"""Distance of the place from the middle of the cloud, in its radii, up to which its views differ
from those of a scanner at infinity."""

MIN_EVEN_PARTS = 7
"""Of RUNS parts of the order, how many have to agree: else they are scans of several places."""

SIGHT_STEP, MIN_SIGHT_STEP, MIN_LOSS_RISE = 0.25, 0.05, 0.08
"""Motion of the place along the line of sight over its distance, at least in radii, and the rise of
the loss from which on the distance is certain: scanners with parallel rays have 0.03 at most, those
with a laser stripe 0.07 (docs/tuning.md)."""


@dataclass(frozen=True, slots=True)
class InferredViewpoint:
    """Place of a scanner, and how sure it is."""

    position: tuple[float, float, float]
    """In the frame of the cloud."""
    certainty: float
    """Share of the points' steps that are equal from there."""


def infer_viewpoint(points: Array) -> InferredViewpoint | None:
    """Find the place from which points (N, 3) that follow one another lie at equal steps.

    Minimises sum_i r_i^2 / (r_i^2 + c^2), r_i = 2 |u_1 - 2 u_2 + u_3| / (|u_2 - u_1| + |u_3 - u_2|)
    of the directions u from the place to three points in a row, by Gauss-Newton steps under
    narrowing scales c (Black and Rangarajan 1996).

    Returns
    -------
    InferredViewpoint or None
        None where the order tells no place with certainty.
    """
    some = take_every(points, USUAL_POINTS)
    centre = np.median(some, axis=0)
    radius = float(np.quantile(distances_from(some, centre), 0.98))
    if len(points) < MIN_TRIPLES or radius == 0:
        return None
    triples = _telling_triples(points, radius)
    if triples is None:
        return None
    triples = (triples - centre) / radius
    place = _find_place(triples)
    are_equal = _are_equal(triples, place)
    if not _is_certain(triples, place, are_equal):
        return None
    x, y, z = (centre + radius * place).tolist()
    return InferredViewpoint((x, y, z), float(are_equal.mean()))


def _telling_triples(points: Array, radius: float) -> Array | None:
    """(K, 3, 3) points in a row, in their order, where the surface bends; None if too few do.

    They come from runs that are spread over the cloud (N, 3) of this radius.
    """
    length = min(MAX_RUN, len(points) // RUNS)
    starts = np.linspace(0, len(points) - length, RUNS).astype(np.intp)
    steps, changes = zip(
        *(step_lengths(points[start : start + length]) for start in starts), strict=True
    )
    if np.median(take_every(np.concatenate(steps), USUAL_POINTS)) > MAX_STEP * radius:
        return None
    bends = [
        2 * change > MIN_BEND * (step[1:] + step[:-1])
        for step, change in zip(steps, changes, strict=True)
    ]
    rows = np.concatenate(
        [start + np.flatnonzero(each) for start, each in zip(starts, bends, strict=True)]
    )
    if len(rows) < MIN_TRIPLES:
        return None
    chosen = np.linspace(0, len(rows) - 1, min(len(rows), MAX_TRIPLES)).astype(np.intp)
    triples: Array = points[rows[chosen, None] + np.arange(3)]
    return triples


def _find_place(triples: Array) -> Array:
    """(3,) place of the least loss, in the middle of the cloud or around it."""
    few = take_every(triples, COARSE_TRIPLES)
    places = _best_places(take_every(triples, START_TRIPLES), _starts(), 0.5, SIFTED_STARTS)
    places = _best_places(few, places, 0.5, DESCENDED_STARTS)
    for scale in COARSE_SCALES:
        places = _move(few, places, scale)
    place = _best_places(few, places, COARSE_SCALES[-1], 1)
    for scale in FINE_SCALES:
        place = _move(triples, place, scale)
    return np.asarray(place[0])


@cache
def _starts() -> Array:
    """(S, 3) places from which the search may start, densest in the middle."""
    grids = [
        spacing * np.stack(np.meshgrid(*[np.arange(-n, n + 1)] * 3), axis=-1).reshape(-1, 3)
        for spacing, n in NEAR_STARTS
    ]
    cube = np.stack(np.meshgrid(*[np.arange(-2.0, 3)] * 3), axis=-1).reshape(-1, 3)
    cube = cube[np.abs(cube).max(axis=1) == 2]
    directions = cube / np.linalg.norm(cube, axis=1)[:, None]
    return np.concatenate([*grids, *(reach * directions for reach in FAR_STARTS)])


def _best_places(triples: Array, places: Array, scale: float, count: int) -> Array:
    """(count, 3) places with the least losses."""
    return np.asarray(places[np.argsort(_losses(triples, places, scale), kind="stable")[:count]])


def _losses(triples: Array, places: Array, scale: float) -> Array:
    """(P,) mean losses at the places under a scale."""
    squares = np.square(unequal_steps(triples, places))
    return np.asarray((squares / (squares + scale**2)).mean(axis=1))


def _move(triples: Array, places: Array, scale: float) -> Array:
    """(P, 3) places after one Gauss-Newton step under a scale of the loss."""
    H, g = step_equations(triples, places, scale)
    held = 1e-9 * np.trace(H, axis1=1, axis2=2) + 1e-30
    H += held[:, None, None] * np.eye(3)
    moved: Array = places + np.linalg.solve(H, g[..., None])[..., 0]
    return moved


def _are_equal(triples: Array, place: Array) -> NDArray[np.bool_]:
    equal: NDArray[np.bool_] = unequal_steps(triples, place[None])[0] < EQUAL_STEP_TOL
    return equal


def _is_certain(triples: Array, place: Array, are_equal: NDArray[np.bool_]) -> bool:
    """Whether enough steps are equal, throughout the order, and fewer from farther or nearer."""
    distance, certainty = float(np.linalg.norm(place)), float(are_equal.mean())
    if not (certainty >= MIN_CERTAINTY and distance <= MAX_DISTANCE):
        return False
    even = [block.mean() >= 0.5 * certainty for block in np.array_split(are_equal, RUNS)]
    sight = place / distance if distance > MIN_SIGHT_STEP else np.array([0.0, 0.0, 1.0])
    step = max(SIGHT_STEP * distance, MIN_SIGHT_STEP) * sight
    moved = np.array([place, place - step, place + step])
    here, nearer, farther = _losses(triples, moved, FINE_SCALES[-1])
    return bool(sum(even) >= MIN_EVEN_PARTS and min(nearer, farther) - here >= MIN_LOSS_RISE)
