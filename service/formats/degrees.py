"""Longitude and latitude in place of lengths: recognised, and refused with what to do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from service.formats.errors import UnsupportedFileError

ADVICE = (
    "project them to metres (for example with pdal translate and filters.reprojection, or in QGIS:"
    " the UTM zone of the place), and send those"
)
"""What callers are told to do."""

_SUBSET_POINTS = 20_000
_MAX_LONGITUDE, _MAX_LATITUDE = 180.0, 90.0
_MIN_HEIGHT_RATIO = 200.0
"""Extent in height over that in the plane: a degree is 111,000 m, so that ground in degrees is a
needle."""
_MIN_OFFSET_RATIO = 10.0
"""Distance of the place from longitude and latitude 0 over its extent."""
_COARSE_STEP = 1e-4
"""Step of coordinates, in degrees 11 m, that says nothing: lengths in tenths of a millimetre."""


def refuse_degrees(points: NDArray[np.floating]) -> None:
    """Refuse points (N, 3) that can only be longitude, latitude and height.

    Raises
    ------
    UnsupportedFileError
        They are.
    """
    subset = points[:: max(1, len(points) // _SUBSET_POINTS)].astype(np.float64)
    subset = subset[np.isfinite(subset).all(axis=1)]
    if len(subset) < 3 or not _are_degrees(subset):
        return
    raise UnsupportedFileError(
        "the coordinates look like longitude and latitude in degrees (in the plane they span"
        f" {np.ptp(subset[:, :2], axis=0).max():.3g}, in height"
        f" {np.ptp(subset[:, 2]):.3g}); expected lengths: {ADVICE}"
    )


def _are_degrees(points: NDArray[np.float64]) -> bool:
    plane = points[:, :2]
    if (np.abs(plane) > (_MAX_LONGITUDE, _MAX_LATITUDE)).any() and (
        np.abs(plane) > (_MAX_LATITUDE, _MAX_LONGITUDE)
    ).any():
        return False
    extent = np.ptp(plane, axis=0).max()
    if not 0 < _MIN_HEIGHT_RATIO * extent < np.ptp(points[:, 2]):
        return False
    if np.abs(plane.mean(axis=0)).max() < _MIN_OFFSET_RATIO * extent:
        return False
    steps = plane / _COARSE_STEP
    return bool(np.median(np.abs(steps - np.round(steps))) > 0.01)
