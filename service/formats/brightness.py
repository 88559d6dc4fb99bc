"""Brightness of points by the names of their attributes: colour and intensity."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import find_colors, unpack_colors
from service.formats.decoded_cloud import DecodedCloud

Brightness = dict[str, NDArray[np.float32]]
"""(N,) by its kind, "color" or "intensity"."""
_INTENSITIES = (
    *("intensity", "scalar_intensity", "reflectance", "scalar_reflectance", "reflectivity"),
    "amplitude",
)
"""Names of attributes that are an intensity, the usual ones first."""


def find_brightness(attributes: Mapping[str, NDArray[np.generic]]) -> Brightness:
    """Find the mean of red, green and blue, and the intensity, as far as they are there."""
    found: Brightness = {}
    colors = find_colors(unpack_colors(attributes))
    if colors is not None:
        found["color"] = colors.values.astype(np.float32).mean(axis=1)
    names = {name.lower(): name for name in attributes}
    name = next((names[each] for each in _INTENSITIES if each in names), None)
    if name is not None and attributes[name].dtype.kind in "iuf":
        found["intensity"] = attributes[name].astype(np.float32)
    return found


def common_brightness(
    source: DecodedCloud, target: DecodedCloud
) -> tuple[NDArray[np.float32] | None, NDArray[np.float32] | None]:
    """Return the brightness (N,) and (M,) of the kind that both clouds have, colour first."""
    for kind, values in source.brightness.items():
        if kind in target.brightness:
            return values, target.brightness[kind]
    return None, None
