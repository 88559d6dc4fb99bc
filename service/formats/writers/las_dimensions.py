"""How attributes fit into the dimensions of a LAS point format."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

WAVEFORM_NAMES = (
    "wavepacket_index",
    "wavepacket_offset",
    "wavepacket_size",
    "return_point_wave_location",
    *("x_t", "y_t", "z_t"),
)
"""Dimensions that refer to waveforms, which are not kept."""
_DIMENSIONS = (
    *("intensity", "return_number", "number_of_returns", "scan_direction_flag"),
    *("edge_of_flight_line", "classification", "synthetic", "key_point", "withheld", "overlap"),
    *("scanner_channel", "user_data", "scan_angle", "scan_angle_rank", "point_source_id"),
    *("gps_time", "red", "green", "blue", "nir"),
)
_SPELLINGS = {name.replace("_", ""): name for name in _DIMENSIONS}
"""Dimensions by their name without underscores: CloudCompare writes scalar_ReturnNumber."""
_DEGREES_PER_STEP = 0.006
"""Degrees of one step of `scan_angle` in the point formats 6 to 10."""
_MAX_DEGREES = 180


@dataclass(frozen=True, slots=True)
class Placed:
    """Where the values of an attribute go."""

    dimension: str
    """Dimension of the point format; empty: none."""
    standard: NDArray[np.generic] | None
    """Values for that dimension."""
    is_whole: bool
    """Whether the dimension holds the values exactly; else extra bytes hold them too."""
    note: str = ""
    """What the caller should know."""


_NOWHERE = Placed("", None, is_whole=False)


def find_dimensions(names: Iterable[str]) -> dict[str, str]:
    """Find the attribute of each dimension, by its name or another spelling of it."""
    known = list(names)
    found: dict[str, str] = {name: name for name in known if name in _DIMENSIONS}
    for name in known:
        bare = name.lower().removeprefix("scalar_").replace("_", "").replace(" ", "")
        dimension = _SPELLINGS.get(bare)
        if dimension is not None:
            found.setdefault(dimension, name)
    return found


def place_column(dimension: str | None, column: NDArray[Any], point_format: Any) -> Placed:
    """Convert the values of an attribute to a dimension, as far as it holds them."""
    if dimension is None:
        return _NOWHERE
    has_ranks = point_format.id < 6
    if dimension in ("scan_angle", "scan_angle_rank"):
        return _place_angle(dimension, column, has_ranks=has_ranks)
    if dimension not in point_format.dimension_names:
        return _NOWHERE
    if dimension == "gps_time":
        return Placed(dimension, column.astype(np.float64), is_whole=True)
    low, high = _bounds(point_format.dimension_by_name(dimension))
    if _fit(column, low, high):
        return Placed(dimension, column.astype(np.int64), is_whole=True)
    if dimension == "intensity":
        return _scale_intensity(column)
    note = f"does not fit LAS ({low} to {high}): it is kept in extra bytes, under another name"
    return Placed("", None, is_whole=False, note=note)


def _place_angle(name: str, column: NDArray[Any], *, has_ranks: bool) -> Placed:
    """Convert scan angles: whole degrees before LAS 1.4, steps of 0.006 degrees since."""
    is_steps = name == "scan_angle" and column.dtype.kind in "iu"
    degrees = column * _DEGREES_PER_STEP if is_steps else column.astype(np.float64)
    if has_ranks:
        wanted, low, high, target = degrees, -128, 127, "scan_angle_rank"
    else:
        wanted = column if is_steps else degrees / _DEGREES_PER_STEP
        low, high, target = -32768, 32767, "scan_angle"
    if not np.isfinite(degrees).all() or (np.abs(degrees) > _MAX_DEGREES + 20).any():
        return Placed("", None, is_whole=False, note="holds no angles of LAS: kept in extra bytes")
    steps = np.clip(np.rint(wanted), low, high).astype(np.int16)
    is_whole = bool(np.allclose(steps, wanted, rtol=0, atol=0.5 if not has_ranks else 1e-6))
    note = "" if is_whole else "is rounded to degrees; its own values are in extra bytes"
    return Placed(target, steps, is_whole=is_whole, note=note)


def _scale_intensity(column: NDArray[Any]) -> Placed:
    """Spread intensities over the 16 bits of LAS; those from 0 to 1 as they are in E57."""
    values = column.astype(np.float64)
    finite = values[np.isfinite(values)]
    low, high = (finite.min(), finite.max()) if len(finite) else (0.0, 1.0)
    if low >= 0 and high <= 1:
        low, high = 0.0, 1.0
    span = high - low if high > low else 1.0
    scaled = np.clip(np.rint(np.nan_to_num((values - low) / span) * 65535), 0, 65535)
    note = (
        f"is scaled from {low:g} to {high:g} to the 16 bits of LAS; "
        "its own values are in extra bytes"
    )
    return Placed("intensity", scaled.astype(np.uint16), is_whole=False, note=note)


def _bounds(dimension: Any) -> tuple[int, int]:
    if dimension.kind.name == "SignedInteger":
        return -(1 << dimension.num_bits - 1), (1 << dimension.num_bits - 1) - 1
    return 0, (1 << dimension.num_bits) - 1


def _fit(column: NDArray[Any], low: int, high: int) -> bool:
    """Whether all values are whole numbers within the bounds."""
    if len(column) == 0:
        return True
    if column.dtype.kind == "f" and not (
        np.isfinite(column).all() and (column == np.rint(column)).all()
    ):
        return False
    return bool(column.min() >= low and column.max() <= high)
