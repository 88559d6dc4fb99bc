"""Rows of a cloud that hold no point: zeros, far values, many copies, and echoes at no surface."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.range_shell import find_range_shell
from mpe_core.geometry.sampling import take_every
from mpe_core.kernels.bounds import bounding_box

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]
Kind = Literal["zeros", "far", "copies", "shell"]

USUAL_POINTS = 2000
"""Points, or up to twice as many, that tell where the others usually lie."""

SUBSET_POINTS = 20_000
"""Points, or up to twice as many, among which copies are counted."""

MIN_POINTS = 20
"""Points that a cloud needs to tell what is usual."""

MIN_ZEROS = 3
"""Rows (0, 0, 0) from which on they are no points; measured ones do not repeat."""

FAR_RADII = 1000.0
"""Distance from the median, in distances within which three quarters of the points lie, beyond
which a point is left out: around a scanner the distances differ by some hundreds."""

REPEATED_FAR_RADII, MIN_REPEATS = 20.0, 3
"""The same for points that repeat one coordinate, as -9999 does, so many times."""

MIN_COPIES, COPIES_OVER_USUAL, MAX_COPIED_PLACES = 20, 20, 20
"""Copies of one place from which on all but one are left out; also over the usual number of copies,
and places at most: coarse grids repeat everywhere."""


@dataclass(frozen=True, slots=True)
class NoData:
    """Rows that were left out of a cloud."""

    kind: Kind
    """Why."""
    count: int
    """How many rows."""


def find_no_data(points: Array, viewpoints: Array | None = None) -> tuple[Rows, tuple[NoData, ...]]:
    """Find rows that stand for no point.

    Parameters
    ----------
    points
        (N, 3) finite points.
    viewpoints
        (k, 3) places of the scanners, if they are known.

    Returns
    -------
    (N,) whether a row stands for no point, and the numbers by kind.
    """
    left_out: Rows = np.zeros(len(points), np.bool_)
    found: list[NoData] = []
    if len(points) < MIN_POINTS:
        return left_out, ()
    rules: dict[Kind, Callable[[Array], Rows | None]] = {
        "zeros": _find_zeros,
        "far": _find_far,
        "copies": _find_copies,
        "shell": lambda kept: find_range_shell(kept, viewpoints),
    }
    for kind, rule in rules.items():
        rows = np.flatnonzero(~left_out)
        is_none = rule(points[rows] if found else points)
        if is_none is not None and is_none.any() and not is_none.all():
            left_out[rows] |= is_none
            found.append(NoData(kind, int(is_none.sum())))
    return left_out, tuple(found)


def _find_zeros(points: Array) -> Rows | None:
    zeros = points[:, 0] == 0
    if np.count_nonzero(zeros) < MIN_ZEROS:
        return None
    zeros &= (points[:, 1] == 0) & (points[:, 2] == 0)
    return zeros if np.count_nonzero(zeros) >= MIN_ZEROS else None


def _find_far(points: Array) -> Rows | None:
    """Points far from all others, by the distance from the median along the axes."""
    subset = take_every(points, USUAL_POINTS)
    median = np.median(subset, axis=0)
    usual = float(np.quantile(np.abs(subset - median).max(axis=1), 0.75))
    low, high = bounding_box(points)
    farthest = max((high - median).max(), (median - low).max())
    if usual == 0 or farthest <= REPEATED_FAR_RADII * usual:
        return None
    distance = np.abs(points - median).max(axis=1)
    far: Rows = distance > FAR_RADII * usual
    for axis in range(3):
        for value in _repeated(points[:, axis][distance > REPEATED_FAR_RADII * usual]):
            if abs(value - median[axis]) > REPEATED_FAR_RADII * usual:
                far |= points[:, axis] == value
    return far if 4 * np.count_nonzero(far) < len(points) else None


def _repeated(values: Array) -> Iterator[float]:
    """Values that repeat, if they are few."""
    distinct, counts = np.unique(values, return_counts=True)
    repeated = distinct[counts >= MIN_REPEATS]
    if len(repeated) <= MAX_COPIED_PLACES:
        yield from repeated.tolist()


def _find_copies(points: Array) -> Rows | None:
    """All but the first of the copies of a place that has many more of them than others."""
    subset = take_every(points, SUBSET_POINTS)
    hashes = _hash_rows(subset)
    if np.bincount((hashes >> np.uint64(48)).astype(np.int64)).max() < MIN_COPIES:
        return None  # as of nearly all clouds, and ten times as fast as counting the places
    _, first, counts = np.unique(hashes, return_index=True, return_counts=True)
    usual = float(np.median(counts))
    many = first[counts >= max(MIN_COPIES, COPIES_OVER_USUAL * usual)]
    if not 0 < len(many) <= MAX_COPIED_PLACES:
        return None
    copies = np.zeros(len(points), np.bool_)
    for place in subset[many]:
        rows = np.flatnonzero((points == place).all(axis=1))
        copies[rows[1:]] = True
    return copies


def _hash_rows(points: Array) -> NDArray[np.uint64]:
    """(N,) numbers that are alike for equal rows, and hardly otherwise."""
    bits = np.ascontiguousarray(points + 0.0).view(np.uint64)  # turns -0.0 into 0.0
    mixed = np.zeros(len(bits), np.uint64)
    for axis, factor in enumerate((0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)):
        mixed = (mixed ^ bits[:, axis]) * np.uint64(factor)
        mixed ^= mixed >> np.uint64(29)
    return mixed
