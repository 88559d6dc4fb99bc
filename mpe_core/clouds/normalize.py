"""The caller's clouds: checked once at the door, then held centred and scaled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpe_core.errors import (
    CloudShapeError,
    CoordinateRangeError,
    DegenerateCloudError,
    InvalidWeightsError,
    TooFewPointsError,
)
from mpe_core.geometry.bounds import Extent, centered, measure_extent, scatter_matrix
from mpe_core.geometry.validation import MAX_COORDINATE

LEAST_RATIO = 1e-4
"""Radius of the smaller cloud over that of the larger one that is still resolved: in float32 the
larger cloud then keeps a thousandth of the smaller one's radius."""

SMALLEST_WEIGHT, LARGEST_WEIGHT = 1e-30, 1e30
"""Others vanish in float32, or overflow in its sums."""

RADIUS_SAMPLE = 200_000
"""Points that the radius is taken from, or up to twice as many."""

THINNEST = 1e-9
"""Thickness over length under which a cloud counts as a line."""


@dataclass(frozen=True, slots=True)
class Cloud:
    """Finite points of one cloud in the caller's frame and unit."""

    points: NDArray[np.float64]
    """(N, 3) finite points, C-contiguous; never the caller's own memory when rows were dropped."""
    kept: NDArray[np.int64] | None
    """(N,) rows of the caller's array that the points came from; None for all, in their order."""
    dropped: int
    """Rows left out because of NaN or infinity."""
    extent: Extent
    weights: NDArray[np.float64] | None = None
    """(N,) the caller's weights K_i, at least 3 of them above 0."""

    def given(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of the caller's array from rows of `points`."""
        return rows if self.kept is None else self.kept[rows]

    def centre(self) -> NDArray[np.float64]:
        """(3,) centre of mass."""
        K = self.masses()
        if K is not None:
            return np.average(self.heavy(self.points), axis=0, weights=K)
        if self.weights is None:
            return self.extent.mean
        return measure_extent(self.heavy(self.points)).mean

    def heavy(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Those of the rows (N, ...) whose points weigh anything."""
        return rows if self.weights is None else rows[self.weights > 0]

    def masses(self) -> NDArray[np.float64] | None:
        """(M,) weights of the points that weigh anything, over the largest; None where all of these
        weigh the same."""
        if self.weights is None:
            return None
        K = self.heavy(self.weights)
        return None if K.min() == K.max() else K / K.max()


@dataclass(frozen=True, slots=True)
class CloudPair:
    """Both clouds, each centred on its own centre of mass, in a common unit of length.

    The unit is the smaller of the two radii, so neither stray points nor a large scene around a
    small part set it. Poses of the centred clouds are turned into the caller's by `to_caller`.
    """

    source: NDArray[np.float64]
    target: NDArray[np.float64]
    source_centre: NDArray[np.float64]
    target_centre: NDArray[np.float64]
    unit: float
    """Length of 1 in the caller's unit."""
    larger: float
    """Radius of the larger cloud in that unit."""

    def to_caller(self, T: NDArray[np.float64]) -> NDArray[np.float64]:
        """(4, 4) pose between the caller's clouds for the pose T between the centred ones."""
        pose = T.copy()
        pose[:3, 3] = self.unit * T[:3, 3] + self.target_centre - T[:3, :3] @ self.source_centre
        return pose

    def viewpoints(
        self, source: tuple[float, ...] | None, target: tuple[float, ...] | None
    ) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
        """Two of the caller's points (3,), one in each cloud's frame, as the centred ones have
        them."""
        return (
            None if source is None else (np.array(source) - self.source_centre) / self.unit,
            None if target is None else (np.array(target) - self.target_centre) / self.unit,
        )

    def from_caller(self, T: NDArray[np.float64]) -> NDArray[np.float64]:
        """(4, 4) pose between the centred clouds for the pose T between the caller's."""
        pose = T.copy()
        moved = T[:3, :3] @ self.source_centre + T[:3, 3]
        pose[:3, 3] = (moved - self.target_centre) / self.unit
        return pose


def as_points(cloud: ArrayLike, name: str = "cloud", weights: ArrayLike | None = None) -> Cloud:
    """Check an (N, 3) array-like of real numbers and drop its rows with NaN or infinity, of the
    coordinates or of the weights (N,).

    Raises
    ------
    CloudShapeError
        Not an (N, 3) array of integers or floats.
    TooFewPointsError
        Fewer than 3 finite rows.
    CoordinateRangeError
        A finite coordinate beyond `MAX_COORDINATE`.
    DegenerateCloudError
        All finite points on one line or in one place.
    InvalidWeightsError
        Not (N,) weights of 0 or more, at least 3 of them above 0.
    """
    array = _as_array(cloud, name)
    points = np.ascontiguousarray(array, np.float64)
    K = None if weights is None else _as_weights(weights, len(points), name)
    reached, kept = measure_extent(points), None
    if not np.isfinite(reached.mean).all() or (K is not None and not np.isfinite(K).all()):
        finite = np.isfinite(array).all(axis=1)
        kept = np.flatnonzero(finite if K is None else finite & np.isfinite(K))
        points, K = points[kept], None if K is None else K[kept]
    if len(points) < 3:
        raise TooFewPointsError(
            f"{name} needs at least 3 finite points, got {len(points)} of {len(array)} rows"
        )
    if kept is not None:
        reached = measure_extent(points)
    found = Cloud(points, kept, len(array) - len(points), reached, K)
    _check_range(found, name)
    _check_thickness(points, reached, name)
    if K is not None:
        heavy = found.heavy(points)
        if len(heavy) < 3:
            raise InvalidWeightsError(
                f"at least 3 weights of the {name} must be above 0, {len(heavy)} of {len(K)} are"
            )
        _check_thickness(heavy, measure_extent(heavy), name)
    return found


def _as_weights(weights: ArrayLike, count: int, name: str) -> NDArray[np.float64]:
    try:
        K = np.asarray(weights, np.float64)
    except (TypeError, ValueError):
        raise InvalidWeightsError(f"the weights of the {name} must be real numbers") from None
    if K.shape != (count,):
        raise InvalidWeightsError(
            f"the {name} has {count} points and needs as many weights, got shape {K.shape}"
        )
    if (K < 0).any():
        row = int(np.argmax(K < 0))
        raise InvalidWeightsError(f"weight {K[row]:g} of point {row} of the {name} is below 0")
    extreme = np.isfinite(K) & (K > 0) & ((K < SMALLEST_WEIGHT) | (K > LARGEST_WEIGHT))
    if extreme.any():
        row = int(np.argmax(extreme))
        raise InvalidWeightsError(
            f"weight {K[row]:g} of point {row} of the {name} is neither 0 nor from"
            f" {SMALLEST_WEIGHT:g} to {LARGEST_WEIGHT:g}"
        )
    return K


def as_pair(source: Cloud, target: Cloud) -> CloudPair:
    """Centre both clouds on their centres of mass and scale them by the smaller radius, that of the
    points that weigh anything."""
    centres = source.centre(), target.centre()
    small, large = sorted(
        radius(cloud.heavy(cloud.points), centre)
        for cloud, centre in zip((source, target), centres, strict=True)
    )
    unit = max(small, LEAST_RATIO * large)
    x, y = (
        centered(cloud.points, centre, unit)
        for cloud, centre in zip((source, target), centres, strict=True)
    )
    return CloudPair(x, y, *centres, unit, large / unit)


def radius(points: NDArray[np.float64], centre: NDArray[np.float64]) -> float:
    """Distance from the centre (3,) within which 98 % of the points lie, from every k-th of many;
    the largest if that is zero."""
    some = points[:: max(1, len(points) // RADIUS_SAMPLE)] - centre
    distance = np.sqrt(np.einsum("ni,ni->n", some, some))
    return float(np.quantile(distance, 0.98)) or float(distance.max())


def _as_array(cloud: ArrayLike, name: str) -> NDArray[np.generic]:
    try:
        array = np.asarray(cloud)
    except ValueError as error:
        raise CloudShapeError(f"{name} must be an (N, 3) array, got rows of unequal length") from (
            error
        )
    if array.dtype.kind not in "iuf":
        raise CloudShapeError(f"{name} must hold integers or floats, got dtype {array.dtype}")
    if array.ndim == 2 and array.shape[1] == 3:
        return array
    if array.size == 0:
        raise TooFewPointsError(f"{name} needs at least 3 finite points, got an empty array")
    raise CloudShapeError(f"{name} must have shape (N, 3), got {array.shape}")


def _check_range(cloud: Cloud, name: str) -> None:
    if cloud.extent.max_coordinate > MAX_COORDINATE:
        row, column = np.unravel_index(np.argmax(np.abs(cloud.points)), cloud.points.shape)
        raise CoordinateRangeError(
            f"{name} has coordinate {cloud.points[row, column]:g} in row"
            f" {cloud.given(np.array([row]))[0]};"
            f" at most {MAX_COORDINATE:g} is exact enough, remove the point or change the unit"
        )


def _check_thickness(points: NDArray[np.float64], reached: Extent, name: str) -> None:
    length = reached.max_offset
    rounding = 8 * np.finfo(np.float64).eps * reached.max_coordinate
    if length <= rounding:
        raise DegenerateCloudError(f"all points of {name} lie in one place")
    spread, axes = np.linalg.eigh(scatter_matrix(points, reached))
    if spread[1] > len(points) * (1e3 * (THINNEST + rounding / length)) ** 2:
        return  # too thick on the average for the exact test to refuse it
    off_axis = np.abs(np.cross(centered(points, reached.mean, length), axes[:, 2])).max()
    if off_axis <= THINNEST + rounding / length:
        raise DegenerateCloudError(
            f"all points of {name} lie on one line; the rotation about it cannot be told"
        )
