"""Brightness of points: their intensity, or the mean of their colour."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpe_core.errors import CloudShapeError

Array = NDArray[np.float64]


def validate_colors(colors: ArrayLike, count: int, name: str) -> Array:
    """Return the brightness (N,) of intensities (N,) or colours (N, 3), NaN where it is unknown.

    Parameters
    ----------
    colors
        Numbers in any unit.
    count
        Number of points N.
    name
        What error messages call the cloud.

    Raises
    ------
    CloudShapeError
        If there are not one or three numbers for each point.
    """
    try:
        values = np.asarray(colors, np.float64)
    except (TypeError, ValueError):
        raise CloudShapeError(f"the colors of the {name} must be real numbers") from None
    if values.shape not in ((count,), (count, 3)):
        raise CloudShapeError(
            f"the {name} has {count} points and needs colors of shape ({count},) for intensity or"
            f" ({count}, 3) for red, green and blue, got {values.shape}"
        )
    brightness = values if values.ndim == 1 else values.mean(axis=1)
    return np.where(np.isfinite(brightness), brightness, np.nan)
