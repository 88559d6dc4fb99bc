"""Gaussian splats in rows of 32 bytes (.splat): position, scale, colour and axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import MalformedFileError
from service.formats.memory_map import map_file

WARNING = "the file holds Gaussian splats: their centres are read as points"
_ROW = np.dtype([("xyz", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("axes", "u1", 4)])
_MIN_ROWS = 4
_MAX_COORDINATE = 1e6
_LENGTH_TOL = 0.05
"""Distance of a quaternion's length from 1; bytes round it to about 0.01."""


def sniff(head: bytes) -> bool:
    """Whether the bytes are rows with positive scales and unit quaternions."""
    rows = np.frombuffer(head, _ROW, len(head) // _ROW.itemsize)
    if len(rows) < _MIN_ROWS:
        return False
    with np.errstate(all="ignore"):
        is_place = (np.abs(rows["xyz"]) < _MAX_COORDINATE).all()
        is_scale = ((rows["scale"] > 0) & (rows["scale"] < _MAX_COORDINATE)).all()
        lengths = np.linalg.norm((rows["axes"].astype(float) - 128) / 128, axis=1)
    return bool(is_place and is_scale and (np.abs(lengths - 1) < _LENGTH_TOL).all())


def read(path: Path, limits: ReadLimits, *, attributes: bool = False) -> DecodedCloud:
    """Read the centres; `attributes` adds colours, opacity, scales and axes, as PLY names them.

    Raises
    ------
    CloudFileError
        The length is no multiple of 32 bytes, or there are too many rows.
    """
    size = path.stat().st_size
    if size % _ROW.itemsize:
        raise MalformedFileError(
            f"the file has {size} bytes; expected a multiple of {_ROW.itemsize}, a row of a splat"
        )
    check_count(size // _ROW.itemsize, _ROW.itemsize, size, "the file", limits)
    rows = np.frombuffer(map_file(path), _ROW)
    kept = _attributes(rows) if attributes else {}
    return DecodedCloud(rows["xyz"].copy(), "splat", (WARNING,), attributes=kept)


def _attributes(rows: NDArray[np.void]) -> dict[str, NDArray[np.generic]]:
    colors = dict(zip(("red", "green", "blue"), rows["rgba"].T[:3].copy(), strict=True))
    axes = ((rows["axes"].astype(np.float32) - 128) / 128).T
    with np.errstate(all="ignore"):
        scales = np.log(rows["scale"]).T
    named: dict[str, NDArray[np.generic]] = {"alpha": rows["rgba"][:, 3].copy()}
    named |= {f"scale_{i}": column.copy() for i, column in enumerate(scales)}
    named |= {f"rot_{i}": column.copy() for i, column in enumerate(axes)}
    return colors | named
