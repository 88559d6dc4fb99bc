"""Beams without echo, written at the largest range: a shell around the scanner."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.distances import distances_from
from mpe_core.geometry.sampling import take_every
from mpe_core.kernels.spheres import fullest_sphere

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

SUBSET_POINTS = 500
"""Points, or up to twice as many, that a sphere is looked for in."""

TRIES = 600
"""Spheres through four points that are tried: many of them lie on a shell of a tenth."""

FAR_SHARE = 0.35
"""Share of the points, the farthest, that the four are drawn from."""

SHELL_TOL = 1e-4
"""Deviation of the range that a shell has at most, over the range: what the files round."""

MIN_SHELL, MAX_SHELL = 0.02, 0.95
"""Share of the points on a shell: fewer do no harm, more are a ball."""

MAX_OUTSIDE = 0.002
"""Share of the points beyond a shell."""

MAX_RADIUS = 2.0
"""Radius of a shell over the largest distance from the median."""

DIRECTION_BINS = 48
"""Bins of a right angle, by which beams count as the same."""

MAX_SHARED_DIRECTIONS = 0.4
"""Share of a shell's directions in which other points lie too: a beam has one echo. Within a ball
that holds things, most are shared."""


def find_range_shell(points: Array, viewpoints: Array | None = None) -> Rows | None:
    """Find the points of a sphere that holds all others and shares no beam with them.

    Parameters
    ----------
    points
        (N, 3) points.
    viewpoints
        (k, 3) places of the scanners; None: the origin and any other place are tried.

    Returns
    -------
    (N,) whether a point lies on the shell; None if there is none.
    """
    subset = take_every(points, SUBSET_POINTS)
    for centre in _centres(subset, viewpoints):
        radius = _shell_radius(subset, centre)
        if radius is None:
            continue
        distance = distances_from(points, centre)
        shell: Rows = np.abs(distance - radius) <= SHELL_TOL * radius
        if _is_shell(points - centre, distance, shell):
            return shell
    return None


def _centres(subset: Array, viewpoints: Array | None) -> Iterator[Array]:
    if viewpoints is not None:
        yield from viewpoints
        return
    yield np.zeros(3)
    if len(subset) >= 8:
        centre = _best_centre(subset)
        if centre is not None:
            yield centre


def _best_centre(subset: Array) -> Array | None:
    """(3,) centre of the sphere through four points that holds the most others."""
    middle = np.median(subset, axis=0)
    distance = distances_from(subset, middle)
    far = subset[np.argsort(distance)[int((1 - FAR_SHARE) * len(subset)) :]] - middle
    rows = np.random.default_rng(0).integers(0, len(far), (TRIES, 4))
    # from a scanner within the cloud; planes lie on huge spheres
    centre, count = fullest_sphere(far[rows], far, SHELL_TOL, MAX_RADIUS * float(distance.max()))
    return centre + middle if count >= MIN_SHELL * len(subset) + 4 else None


def _shell_radius(subset: Array, centre: Array) -> float | None:
    """Range of the farthest points, if enough of them have the same."""
    distance = np.sort(distances_from(subset, centre))
    outermost = distance[: len(distance) - int(MAX_OUTSIDE * len(distance))][-1]
    radius = float(np.median(distance[distance > (1 - SHELL_TOL) * outermost]))
    share = np.mean(np.abs(distance - radius) <= SHELL_TOL * radius)
    return radius if radius > 0 and MIN_SHELL <= share <= MAX_SHELL else None


def _is_shell(rays: Array, ranges: Array, shell: Rows) -> bool:
    outside = np.count_nonzero(ranges > 1.0005 * ranges[shell].max()) if shell.any() else 0
    if not MIN_SHELL <= shell.mean() <= MAX_SHELL or outside > MAX_OUTSIDE * len(rays):
        return False
    beams = _direction_bins(rays)
    shared = np.isin(beams[shell], beams[~shell])
    return bool(shared.mean() <= MAX_SHARED_DIRECTIONS)


def _direction_bins(rays: Array) -> NDArray[np.int64]:
    """(N,) number of the bin of directions of each ray (N, 3)."""
    height = rays[:, 2] / np.maximum(np.linalg.norm(rays, axis=1), np.finfo(float).tiny)
    rows = np.round(np.arcsin(np.clip(height, -1, 1)) * DIRECTION_BINS / (np.pi / 2))
    turn = np.arctan2(rays[:, 1], rays[:, 0]) * DIRECTION_BINS / (np.pi / 2)
    columns = np.round(turn * np.cos(rows / DIRECTION_BINS * np.pi / 2))
    bins: NDArray[np.int64] = (rows * 16 * DIRECTION_BINS + columns).astype(np.int64)
    return bins
