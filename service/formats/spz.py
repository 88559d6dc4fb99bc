"""Compressed Gaussian splats of Niantic (.spz), versions 2 and 3, inside of gzip: the centres."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import TruncatedFileError, UnsupportedFileError
from service.formats.memory_map import map_file
from service.formats.splat import WARNING

MAGIC = b"NGSP"
_HEADER = struct.Struct("<4sII4B")
_VERSIONS = (2, 3)
_COLOR_SCALE = 0.15
"""Harmonics of 3.3 are white: the format spreads those of -3.3 to 3.3 over a byte."""
_POSITION_BYTES, _COLOR_BYTES = 9, 3


def read(path: Path, limits: ReadLimits, *, attributes: bool = False) -> DecodedCloud:
    """Read the centres; `attributes` adds colours and opacity, a warning names what is not kept.

    Raises
    ------
    CloudFileError
        The file is damaged or of another version.
    """
    content = map_file(path)
    if len(content) < _HEADER.size:
        raise TruncatedFileError(f"byte {len(content)}: the file ends within its header")
    _, version, count, _, fraction, _, _ = _HEADER.unpack_from(content)
    if version not in _VERSIONS or fraction > 24:
        raise UnsupportedFileError(
            f"byte 4: SPZ version {version}; expected 2 or 3: save it as PLY"
        )
    row_bytes = _POSITION_BYTES + 1 + _COLOR_BYTES
    check_count(count, row_bytes, len(content) - _HEADER.size, "byte 8", limits)
    packed = np.frombuffer(content, np.uint8, count * _POSITION_BYTES, _HEADER.size)
    low, middle, high = packed.reshape(-1, 3).T.astype(np.int32)
    signed = low | middle << 8 | high.astype(np.int8).astype(np.int32) << 16
    points = (signed / float(1 << fraction)).astype(np.float32).reshape(-1, 3)
    cloud = DecodedCloud(points, "spz", (WARNING,))
    if not attributes:
        return cloud
    start = _HEADER.size + count * _POSITION_BYTES
    alpha = np.frombuffer(content, np.uint8, count, start)
    colors = np.frombuffer(content, np.uint8, 3 * count, start + count).reshape(-1, 3)
    kept: dict[str, NDArray[np.generic]] = {"alpha": alpha.copy()}
    kept |= {f"f_dc_{i}": _to_harmonic(colors[:, i]) for i in range(3)}
    lost = "scales, rotations and harmonics of the splats are not kept: convert them to PLY"
    return DecodedCloud(points, "spz", (WARNING, lost), attributes=kept)


def _to_harmonic(column: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the constant harmonic that a byte stands for, as PLY files have it."""
    return ((column.astype(np.float32) / 255 - 0.5) / _COLOR_SCALE).astype(np.float32)
