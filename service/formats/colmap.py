"""COLMAP's points3D.bin: sparse points of a reconstruction from pictures.

A number of points (uint64); each point is an identifier (uint64), x, y, z (float64), red, green,
blue (uint8), an error (float64), and a track: its length (uint64) and pairs of int32.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import MalformedFileError, TruncatedFileError
from service.formats.memory_map import map_file

_COUNT = struct.Struct("<Q")
_POINT = np.dtype(
    [("id", "<u8"), ("xyz", "<f8", 3), ("rgb", "u1", 3), ("error", "<f8"), ("track", "<u8")]
)
_PAIR_BYTES = 8
_BLOCK_POINTS = 100_000
"""Points that are gathered at once, to bound the memory."""
_MAX_COORDINATE, _MAX_ERROR = 1e9, 1e4
_MAX_TRACK = 100_000
"""Pictures that may show a point."""
_SNIFFED_POINTS = 8


def sniff(head: bytes) -> bool:
    """Whether the bytes are a count and plausible points, one after the other."""
    if len(head) < _COUNT.size + _POINT.itemsize:
        return False
    (count,) = _COUNT.unpack_from(head)
    offset, seen = _COUNT.size, 0
    while seen < min(count, _SNIFFED_POINTS) and offset + _POINT.itemsize <= len(head):
        point = np.frombuffer(head, _POINT, 1, offset)[0]
        if not _is_plausible(point, count):
            return False
        offset += _POINT.itemsize + _PAIR_BYTES * int(point["track"])
        seen += 1
    return seen > 0


def read(path: Path, limits: ReadLimits, *, attributes: bool = False) -> DecodedCloud:
    """Read all points; `attributes` adds colours, errors, identifiers and lengths of tracks.

    Raises
    ------
    CloudFileError
        The file is damaged; the message names the byte.
    """
    content = map_file(path)
    if len(content) < _COUNT.size:
        raise TruncatedFileError(f"byte {len(content)}: the file ends within its count of points")
    (count,) = _COUNT.unpack_from(content)
    check_count(count, _POINT.itemsize, len(content) - _COUNT.size, "byte 0", limits)
    if count == 0:
        raise MalformedFileError("byte 0: the file holds no points")
    points = _gather(content, _find_offsets(content, count))
    return DecodedCloud(
        points["xyz"].copy(), "colmap", attributes=_attributes(points) if attributes else {}
    )


def _find_offsets(content: memoryview, count: int) -> NDArray[np.int64]:
    """Follow the tracks from point to point; return the byte of each point."""
    offsets = np.empty(count, np.int64)
    offset, size, read_length = _COUNT.size, _POINT.itemsize, _COUNT.unpack_from
    for number in range(count):
        end = offset + size
        if end > len(content):
            raise TruncatedFileError(
                f"byte {offset}: the file ends after {number} of {count} points"
            )
        offsets[number] = offset
        offset = end + _PAIR_BYTES * read_length(content, end - _COUNT.size)[0]
    if offset > len(content):
        raise TruncatedFileError("the file ends within the track of its last point")
    return offsets


def _gather(content: memoryview, offsets: NDArray[np.int64]) -> NDArray[np.void]:
    whole = np.frombuffer(content, np.uint8)
    points = np.empty(len(offsets), _POINT)
    rows = points.view(np.uint8).reshape(-1, _POINT.itemsize)
    for start in range(0, len(offsets), _BLOCK_POINTS):
        part = offsets[start : start + _BLOCK_POINTS, None] + np.arange(_POINT.itemsize)
        rows[start : start + _BLOCK_POINTS] = whole[part]
    return points


def _attributes(points: NDArray[np.void]) -> dict[str, NDArray[np.generic]]:
    colors = dict(zip(("red", "green", "blue"), points["rgb"].T.copy(), strict=True))
    others = {"point_id": points["id"], "error": points["error"], "track_length": points["track"]}
    return colors | {name: column.copy() for name, column in others.items()}


def _is_plausible(point: np.void, count: int) -> bool:
    is_place = bool((np.abs(point["xyz"]) < _MAX_COORDINATE).all() and point["xyz"].any())
    return (
        is_place
        and -1 <= point["error"] < _MAX_ERROR
        and 0 < point["track"] < _MAX_TRACK
        and point["id"] < max(1 << 40, count)
    )
