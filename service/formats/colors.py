"""Colours of points: found by their names, and converted to 8 or 16 bits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

RGB = ("red", "green", "blue")
_TRIPLES = (
    RGB,
    ("r", "g", "b"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("colorred", "colorgreen", "colorblue"),
    ("rgb:0", "rgb:1", "rgb:2"),
)
_EXACT_TOL = 1e-4
"""Distance of an 8-bit colour from a whole number up to which nothing is rounded away."""


@dataclass(frozen=True, slots=True)
class Colors:
    """Red, green and blue of each point."""

    values: NDArray[np.generic]
    """(N, 3) as in the file."""
    white: float
    """Value of full brightness: 1, 255 or 65535."""
    names: tuple[str, ...]
    """Attributes that they come from."""

    def to_8_bits(self) -> NDArray[np.uint8]:
        """Return (N, 3), rounded."""
        return np.rint(self._scaled(255)).astype(np.uint8)

    def to_16_bits(self) -> NDArray[np.uint16]:
        """Return (N, 3), rounded."""
        return np.rint(self._scaled(65535)).astype(np.uint16)

    @property
    def fit_8_bits(self) -> bool:
        """Whether 8 bits hold them exactly."""
        if self.white == 255 and self.values.dtype.kind in "iu":
            return True
        scaled = self._scaled(255)
        return bool(np.allclose(scaled, np.rint(scaled), rtol=0, atol=_EXACT_TOL))

    def _scaled(self, white: int) -> NDArray[np.float64]:
        values = np.nan_to_num(self.values.astype(np.float64))
        if self.white == 65535 and white == 255 and self._are_shifted():
            return values // 256
        return values * (white / self.white)

    def _are_shifted(self) -> bool:
        """Whether 8-bit colours were shifted by 8 bits, so that full brightness is 65280."""
        return self.values.dtype.kind in "iu" and not (self.values.astype(np.int64) & 255).any()


def find_colors(attributes: Mapping[str, NDArray[np.generic]]) -> Colors | None:
    """Find red, green and blue by their names; None where they are missing or no colours.

    Full brightness is 1 for fractions, else 255 or 65535, whichever holds the largest value.
    """
    places = {name.lower(): name for name in attributes}
    for triple in _TRIPLES:
        if all(name in places for name in triple):
            names = tuple(places[name] for name in triple)
            values = np.stack([attributes[name] for name in names], axis=1)
            white = _find_white(values)
            return None if white is None else Colors(values, white, names)
    return None


def unpack_colors(attributes: Mapping[str, NDArray[np.generic]]) -> dict[str, NDArray[np.generic]]:
    """Replace a packed colour "rgb" or "rgba", as in PCD files, by its 8-bit parts.

    An alpha that is the same for all points is left out.
    """
    unpacked: dict[str, NDArray[np.generic]] = {}
    taken = {name.lower() for name in attributes}
    for name, column in attributes.items():
        bits = _packed_bits(column) if name.lower() in ("rgb", "rgba") else None
        if bits is None or taken & set(RGB):
            unpacked[name] = column
            continue
        for part, shift in zip(RGB, (16, 8, 0), strict=True):
            unpacked[part] = (bits >> shift & 255).astype(np.uint8)
        alpha = (bits >> 24).astype(np.uint8)
        if name.lower() == "rgba" and "alpha" not in taken and len(np.unique(alpha)) > 1:
            unpacked["alpha"] = alpha
    return unpacked


def pack_colors(colors: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Pack 8-bit colours (N, 3) into the bits of a float32, as PCL expects."""
    red, green, blue = colors.T.astype(np.uint32)
    packed: NDArray[np.uint32] = red << 16 | green << 8 | blue
    return packed.view(np.float32)


def _packed_bits(column: NDArray[np.generic]) -> NDArray[np.uint32] | None:
    if column.dtype == np.float32:
        return np.ascontiguousarray(column).view(np.uint32)
    return column.astype(np.uint32) if column.dtype in (np.uint32, np.int32) else None


def _find_white(values: NDArray[np.generic]) -> float | None:
    if values.dtype == np.uint8:
        return 255
    finite = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    if values.dtype.kind not in "iuf" or len(finite) == 0 or finite.min() < 0:
        return None
    largest = finite.max()
    if values.dtype.kind == "f" and largest <= 1:
        return 1
    return next((white for white in (255, 65535) if largest <= white), None)
