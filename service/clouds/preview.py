"""Previews: a cloud thinned to what a browser draws, in a small binary form.

Little-endian: the bytes "MPEV", uint32 version, uint32 flags (1: colours, 2: distances), uint32
number n of points, uint64 number of points of the cloud, three float64 origin; then n x 3 float32
positions relative to the origin, n x 4 uint8 colours (red, green, blue, 255) if there are any, and
n float32 distances if there are any.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats import DecodedCloud
from service.formats.colors import find_colors, unpack_colors

MAGIC, VERSION = b"MPEV", 1
HEADER = struct.Struct("<4sIIIQ3d")
HAS_COLORS, HAS_DISTANCES = 1, 2
"""Bits of the flags."""
_SEED = 0
"""Seed of the choice of points: a preview of the same cloud is the same."""


def choose_rows(points: NDArray[np.floating], max_points: int) -> NDArray[np.intp]:
    """Choose at most so many rows without NaN or infinity.

    They are in random order, so that the first ones are a thinner preview.
    """
    rows = np.flatnonzero(np.isfinite(points).all(axis=1))
    return np.random.default_rng(_SEED).permutation(rows)[:max_points]


def write_preview(
    path: Path,
    cloud: DecodedCloud,
    rows: NDArray[np.intp],
    distances: NDArray[np.floating] | None = None,
) -> None:
    """Write these rows of a cloud, with their colours where it has them.

    Parameters
    ----------
    path
        File to write.
    cloud
        The cloud with its attributes.
    rows
        (N,) rows to write.
    distances
        (N,) distance of each of them from the surface of the target.
    """
    points = cloud.points[rows].astype(np.float64)
    origin = points.mean(axis=0) if len(rows) else np.zeros(3)
    parts = [(points - origin).astype("<f4").tobytes()]
    flags = 0
    if (colors := find_colors(unpack_colors(cloud.attributes))) is not None:
        flags |= HAS_COLORS
        opaque = np.full((len(rows), 1), 255, np.uint8)
        parts.append(np.hstack([colors.to_8_bits()[rows], opaque]).tobytes())
    if distances is not None:
        flags |= HAS_DISTANCES
        parts.append(distances.astype("<f4").tobytes())
    header = HEADER.pack(MAGIC, VERSION, flags, len(rows), len(cloud.points), *origin)
    path.write_bytes(b"".join([header, *parts]))
