"""A decoded cloud, and the limits that a file is held to before memory is taken for it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from service.formats.errors import FileLimitError, TruncatedFileError


@dataclass(frozen=True, slots=True)
class DecodedCloud:
    """Points as the file holds them, in its unit, frame and precision; NaN rows are kept."""

    points: NDArray[np.floating]
    """(N, 3) float32 or float64 in native byte order; integer coordinates become float64."""
    format: str
    """Name of the format that was read, as listed in FORMATS."""
    warnings: tuple[str, ...] = ()
    """What was odd about the file and how it was understood."""
    normals: NDArray[np.floating] | None = None
    """(N, 3) as stored, where the file has them; not normalised."""
    viewpoint: tuple[float, ...] | None = None
    """Sensor pose of a PCD file: tx, ty, tz, qw, qx, qy, qz."""
    attributes: dict[str, NDArray[np.generic]] = field(default_factory=dict)
    """(N,) columns beside the coordinates by their names in the file, only if asked for."""
    weights: NDArray[np.generic] | None = None
    """(N,) the attribute that was asked for as how much each point counts."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds that are checked before memory is taken."""

    max_points: int = 50_000_000
    max_header_bytes: int = 1 << 18
    max_header_lines: int = 2_000
    max_line_bytes: int = 1 << 16
    max_properties: int = 256
    max_expansion: int = 100
    """Largest ratio of expanded to compressed bytes; real clouds stay below 20."""


def check_count(count: int, row_bytes: int, present: int, at: str, limits: Limits) -> None:
    """Refuse an announced number of points that the limit forbids or the bytes cannot hold.

    Raises
    ------
    FileLimitError
        More than ``limits.max_points``.
    TruncatedFileError
        ``count`` rows of at least ``row_bytes`` bytes do not fit into ``present`` bytes.
    """
    if count > limits.max_points:
        raise FileLimitError(f"{at}: {count} points; at most {limits.max_points} are read")
    if count * row_bytes > present:
        raise TruncatedFileError(
            f"{at}: {count} points need at least {count * row_bytes} bytes, {present} are there"
        )
