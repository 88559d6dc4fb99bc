"""Validation of the caller's clouds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpe_core.clouds.brightness import validate_colors
from mpe_core.clouds.no_data import NoData, find_no_data
from mpe_core.errors import (
    CloudShapeError,
    CoordinateRangeError,
    DegenerateCloudError,
    InvalidWeightsError,
    TooFewPointsError,
)
from mpe_core.geometry.bounds import Extent, centered, measure_extent, scatter_matrix
from mpe_core.geometry.distances import distances_from
from mpe_core.geometry.rigid import mirrored
from mpe_core.geometry.validation import MAX_COORDINATE, MIN_EXTENT
from mpe_core.geometry.viewpoints import as_viewpoints
from mpe_core.options import Viewpoints

Array = NDArray[np.float64]

MIN_WEIGHT, MAX_WEIGHT = 1e-30, 1e30
"""Range of the weights above 0: others vanish in float32, or overflow in its sums."""

MIN_THICKNESS = 1e-9
"""Thickness over length under which a cloud counts as a line."""


@dataclass(frozen=True, slots=True)
class Cloud:
    """Finite points of one cloud in the caller's frame and unit."""

    points: Array
    """(N, 3) finite points, C-contiguous; a copy if rows were dropped."""
    original_rows: NDArray[np.int64] | None
    """(N,) rows of the caller's array that the points came from; None for all, in their order."""
    dropped_rows: int
    """Number of rows ignored because of NaN or infinity."""
    extent: Extent
    """Bounds and mean of the points."""
    weights: Array | None = None
    """(N,) the caller's weights K_i, at least 3 of them above 0."""
    no_data: tuple[NoData, ...] = ()
    """Rows that were left out because they stand for no point."""
    brightness: Array | None = None
    """(N,) intensity, or mean of the colour, NaN where it is unknown."""

    def scaled(self, factor: float) -> Cloud:
        """Return the cloud with its coordinates times a factor above 0."""
        points = self.points * factor
        return replace(self, points=points, extent=measure_extent(points))

    def mirrored(self) -> Cloud:
        """Return the cloud with x turned to -x."""
        points = mirrored(self.points)
        return replace(self, points=points, extent=measure_extent(points))

    def spread(self) -> float:
        """Root mean square distance of the points from their mean."""
        points = self.weighted(self.points)
        return float(np.sqrt(np.square(distances_from(points, points.mean(axis=0))).mean()))

    def original_index(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of the caller's array, for rows of `points`."""
        return rows if self.original_rows is None else self.original_rows[rows]

    def centroid(self) -> Array:
        """(3,) centre of mass under the weights."""
        weights = self.normalized_weights()
        if weights is not None:
            return np.average(self.weighted(self.points), axis=0, weights=weights)
        if self.weights is None:
            return self.extent.mean
        return measure_extent(self.weighted(self.points)).mean

    def weighted(self, rows: Array) -> Array:
        """Those of the rows (N, ...) whose points have a weight above 0."""
        return rows if self.weights is None else rows[self.weights > 0]

    def normalized_weights(self) -> Array | None:
        """(M,) weights above 0 over the largest; None if all of these are the same."""
        if self.weights is None:
            return None
        weights = self.weighted(self.weights)
        return None if weights.min() == weights.max() else weights / weights.max()


def validate_cloud(
    cloud: ArrayLike,
    name: str = "cloud",
    weights: ArrayLike | None = None,
    *,
    keep_no_data: bool = True,
    viewpoints: Viewpoints | None = None,
    colors: ArrayLike | None = None,
) -> Cloud:
    """Check a cloud, and drop its rows with NaN or infinity in a coordinate or weight.

    Parameters
    ----------
    cloud
        (N, 3) array-like of real numbers.
    name
        What error messages call it.
    weights
        (N,) weights of 0 or more.
    keep_no_data
        Whether rows that stand for no point are kept.
    viewpoints
        (3,) or (k, 3) places of the scanners, if they are known.
    colors
        (N,) intensities or (N, 3) colours.

    Raises
    ------
    CloudShapeError
        If the cloud is not an (N, 3) array of integers or floats, or its colors do not fit.
    TooFewPointsError
        If fewer than 3 rows are finite.
    CoordinateRangeError
        If a finite coordinate is beyond `MAX_COORDINATE`.
    DegenerateCloudError
        If all finite points lie on one line or in one place.
    InvalidWeightsError
        If there is not one weight of 0 or more for each point, at least 3 of them above 0.
    """
    array = _as_array(cloud, name)
    points = np.ascontiguousarray(array, np.float64)
    K = None if weights is None else _validate_weights(weights, len(points), name)
    brightness = None if colors is None else validate_colors(colors, len(points), name)
    bounds, rows = measure_extent(points), None
    if not np.isfinite(bounds.mean).all() or (K is not None and not np.isfinite(K).all()):
        is_finite = np.isfinite(array).all(axis=1)
        rows = np.flatnonzero(is_finite if K is None else is_finite & np.isfinite(K))
        points, K = points[rows], None if K is None else K[rows]
    dropped = len(array) - len(points)
    no_data: tuple[NoData, ...] = ()
    if not keep_no_data:
        places = None if viewpoints is None else as_viewpoints(viewpoints)
        left_out, no_data = find_no_data(points, places)
        if no_data:
            kept = np.flatnonzero(~left_out)
            rows, points = kept if rows is None else rows[kept], points[kept]
            K = None if K is None else K[kept]
    if len(points) < 3:
        raise TooFewPointsError(
            f"{name} needs at least 3 finite points, got {len(points)} of {len(array)} rows"
        )
    if rows is not None:
        bounds = measure_extent(points)
        brightness = None if brightness is None else brightness[rows]
    valid = Cloud(points, rows, dropped, bounds, K, no_data, brightness)
    _check_range(valid, name)
    _check_thickness(points, bounds, name)
    if K is not None:
        _check_weighted_points(valid, name)
    return valid


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


def _validate_weights(weights: ArrayLike, count: int, name: str) -> Array:
    try:
        K = np.asarray(weights, np.float64)
    except (TypeError, ValueError):
        raise InvalidWeightsError(f"the weights of the {name} must be real numbers") from None
    if K.shape != (count,):
        raise InvalidWeightsError(
            f"the {name} has {count} points and needs weights of shape ({count},), got {K.shape}"
        )
    if (K < 0).any():
        row = int(np.argmax(K < 0))
        raise InvalidWeightsError(
            f"the weights of the {name} must be 0 or more, got {K[row]:g} for point {row}"
        )
    is_extreme = np.isfinite(K) & (K > 0) & ((K < MIN_WEIGHT) | (K > MAX_WEIGHT))
    if is_extreme.any():
        row = int(np.argmax(is_extreme))
        raise InvalidWeightsError(
            f"the weights of the {name} must be 0 or from {MIN_WEIGHT:g} to {MAX_WEIGHT:g},"
            f" got {K[row]:g} for point {row}"
        )
    return K


def _check_range(cloud: Cloud, name: str) -> None:
    if cloud.extent.max_coordinate > MAX_COORDINATE:
        row, column = np.unravel_index(np.argmax(np.abs(cloud.points)), cloud.points.shape)
        raise CoordinateRangeError(
            f"{name} must have coordinates of at most {MAX_COORDINATE:g}, got"
            f" {cloud.points[row, column]:g} in row {cloud.original_index(np.array([row]))[0]}:"
            " remove the point, or use a larger unit of length"
        )


def _check_thickness(points: Array, bounds: Extent, name: str) -> None:
    length = bounds.max_offset
    rounding = 8 * np.finfo(np.float64).eps * bounds.max_coordinate
    if length <= max(rounding, MIN_EXTENT):
        raise DegenerateCloudError(
            f"all points of {name} lie in one place: a rotation cannot be determined"
        )
    spread, axes = np.linalg.eigh(scatter_matrix(points, bounds))
    if spread[1] > len(points) * (1e3 * (MIN_THICKNESS + rounding / length)) ** 2:
        return  # too thick on the average for the exact test to refuse it
    off_axis = np.abs(np.cross(centered(points, bounds.mean, length), axes[:, 2])).max()
    if off_axis <= MIN_THICKNESS + rounding / length:
        raise DegenerateCloudError(
            f"all points of {name} lie on one line: the rotation about it cannot be determined"
        )


def _check_weighted_points(cloud: Cloud, name: str) -> None:
    weighted = cloud.weighted(cloud.points)
    if len(weighted) < 3:
        raise InvalidWeightsError(
            f"at least 3 weights of the {name} must be above 0, got {len(weighted)} of"
            f" {len(cloud.points)}"
        )
    _check_thickness(weighted, measure_extent(weighted), name)
