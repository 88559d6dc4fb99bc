"""Livox LVX2 recordings ("LVX2 Specifications", Livox, 2023): the points of all frames.

Frames hold packages of points of one device; points are in millimetres or centimetres.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import MalformedFileError, TruncatedFileError, UnsupportedFileError
from service.formats.memory_map import map_file

MAGIC = b"livox_tech\0"
_HEADER = struct.Struct("<16s4BIIB")
_DEVICE = struct.Struct("<32sI2xB6f")
_FRAME = struct.Struct("<3Q")
_PACKAGE = struct.Struct("<BI2xQHBI5x")
_MAGIC_CODE = 0xAC0EA767
_KINDS = {
    1: (np.dtype([("xyz", "<i4", 3), ("reflectivity", "u1"), ("tag", "u1")]), 0.001),
    2: (np.dtype([("xyz", "<i2", 3), ("reflectivity", "u1"), ("tag", "u1")]), 0.01),
}
"""Layout of a point and its unit in metres, by the type of the data."""


def read(path: Path, limits: ReadLimits, *, attributes: bool = False) -> DecodedCloud:
    """Read the points in metres, moved by the poses of their devices where these are enabled.

    Points at (0, 0, 0) are missing returns and become NaN. `attributes` adds the reflectivity as
    intensity, the tag, and the time in nanoseconds.

    Raises
    ------
    CloudFileError
        The file is damaged or of the older version LVX.
    """
    content = map_file(path)
    poses, offset = _read_devices(content)
    points: list[NDArray[np.float64]] = [np.empty((0, 3))]
    columns: dict[str, list[NDArray[np.generic]]] = {"intensity": [], "tag": [], "time": []}
    total = 0
    for device, time, kind, start, length in _packages(content, offset):
        layout, unit = _KINDS[kind]
        rows = np.frombuffer(content, layout, length // layout.itemsize, start)
        total += len(rows)
        check_count(total, 0, 0, f"byte {start}", limits)
        points.append(_place(rows["xyz"], unit, poses.get(device)))
        if attributes:
            columns["intensity"].append(rows["reflectivity"])
            columns["tag"].append(rows["tag"])
            columns["time"].append(np.full(len(rows), time, np.uint64))
    if total == 0:
        raise MalformedFileError("the recording holds no points")
    kept = {name: np.concatenate(parts) for name, parts in columns.items() if parts}
    warnings = ("all frames of the recording are merged",)
    return DecodedCloud(np.concatenate(points), "lvx2", warnings, attributes=kept)


def _read_devices(content: memoryview) -> tuple[dict[int, NDArray[np.float64]], int]:
    """Return the pose (4, 4) of each device with one, and the byte of the first frame."""
    if len(content) < _HEADER.size:
        raise TruncatedFileError(f"byte {len(content)}: the file ends within its header")
    _, major, minor, _, _, code, _, count = _HEADER.unpack_from(content)
    if code != _MAGIC_CODE or major != 2:
        raise UnsupportedFileError(
            f"LVX version {major}.{minor}; expected 2.0: save it as LVX2, LAS or PCD"
        )
    offset = _HEADER.size
    if offset + count * _DEVICE.size > len(content):
        raise TruncatedFileError(f"byte {offset}: {count} devices do not fit into the file")
    poses = {}
    for _ in range(count):
        _, device, is_enabled, *numbers = _DEVICE.unpack_from(content, offset)
        if is_enabled:
            poses[device] = _pose(*numbers)
        offset += _DEVICE.size
    return poses, offset


def _packages(content: memoryview, offset: int) -> Iterator[tuple[int, int, int, int, int]]:
    """Yield device, time, kind of data, byte and length of each package of points."""
    while offset + _FRAME.size <= len(content):
        current, following, _ = _FRAME.unpack_from(content, offset)
        if current != offset or not offset + _FRAME.size <= following <= len(content):
            raise TruncatedFileError(
                f"byte {offset}: a frame from byte {current} to {following} of {len(content)}; "
                "is the file complete?"
            )
        place, offset = offset + _FRAME.size, following
        while place + _PACKAGE.size <= following:
            _, device, time, _, kind, length = _PACKAGE.unpack_from(content, place)
            start = place + _PACKAGE.size
            if kind not in _KINDS or start + length > following:
                raise MalformedFileError(
                    f"byte {place}: a package of kind {kind} with {length} bytes; expected kind 1 "
                    "or 2 within its frame"
                )
            yield device, time, kind, start, length
            place = start + length
    if offset < len(content):
        raise TruncatedFileError(f"byte {offset}: the file ends within the header of a frame")


def _place(
    counts: NDArray[np.generic], unit: float, pose: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    points = counts.astype(np.float64) * unit
    missing = ~points.any(axis=1)
    if pose is not None:
        points = points @ pose[:3, :3].T + pose[:3, 3]
    points[missing] = np.nan
    return points


def _pose(
    roll: float, pitch: float, yaw: float, x: float, y: float, z: float
) -> NDArray[np.float64]:
    """Return the pose of angles in degrees about x, then y, then z, and a place in metres."""
    if not all(map(math.isfinite, (roll, pitch, yaw, x, y, z))):
        raise MalformedFileError("the pose of a device is not finite")
    (a, b, c), (s, t, u) = (
        [f(math.radians(angle)) for angle in (roll, pitch, yaw)] for f in (math.cos, math.sin)
    )
    pose = np.eye(4)
    pose[:3, :3] = [
        [c * b, c * t * s - u * a, c * t * a + u * s],
        [u * b, u * t * s + c * a, u * t * a - c * s],
        [-t, b * s, b * a],
    ]
    pose[:3, 3] = x, y, z
    return pose
