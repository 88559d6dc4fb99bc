"""Leica's PTX: scans on a grid in ASCII, each with the pose that moves it into a common frame."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, Limits, check_count
from service.formats.errors import MalformedFileError
from service.formats.multi_scan import chosen
from service.formats.text_table import read_columns

_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_LINE = rb"[ \t]*\r?\n"
_HEADER = re.compile(
    rb"[ \t]*(\d{1,9})" + _LINE + rb"[ \t]*(\d{1,9})" + _LINE
    + rb"((?:[ \t]*" + rb"[ \t]+".join([_NUMBER] * 3) + _LINE + rb"){4})"
    + rb"((?:[ \t]*" + rb"[ \t]+".join([_NUMBER] * 4) + _LINE + rb"){4})"
)  # fmt: skip
_HEADER_LINES = 10
_MOST_SCANS = 1000


def sniff(head: bytes) -> bool:
    """Whether the bytes begin with columns, rows, four lines of three and four of four numbers."""
    return _HEADER.match(head) is not None


def read(path: Path, limits: Limits, scan: int | None) -> DecodedCloud:
    """Read a scan (counted from 0), or all, moved by their matrices; (0, 0, 0) becomes NaN.

    A matrix stands in the file for row vectors: x y z 1 times it gives the moved point.

    Raises
    ------
    CloudFileError
        With the line at fault.
    """
    scans: list[NDArray[np.float64]] = []
    offset, line, size = 0, 1, path.stat().st_size
    while offset < size:
        with path.open("rb") as file:
            file.seek(offset)
            head = file.read(limits.max_header_bytes)
        if scans and not head.strip():
            break
        found = _HEADER.match(head)
        if found is None or len(scans) >= _MOST_SCANS:
            raise MalformedFileError(f"line {line}: no header of a PTX scan")
        count = int(found[1]) * int(found[2])
        total = count + sum(map(len, scans))
        check_count(total, 0, 0, f"line {line}", limits)
        check_count(count, 6, size - offset, f"line {line}", limits)
        offset, line = offset + found.end(), line + _HEADER_LINES
        points = read_columns(path, offset, line, (0, 1, 2), limits, rows=count)
        scans.append(_moved(points, np.array(found[4].split(), float).reshape(4, 4)))
        offset, line = _after(path, offset, count), line + count
    wanted, warnings = chosen(len(scans), scan)
    return DecodedCloud(np.concatenate([scans[i] for i in wanted]), "ptx", warnings)


def _moved(points: NDArray[np.float64], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    missing = ~points.any(axis=1)
    moved = points @ matrix[:3, :3] + matrix[3, :3]
    moved[missing] = np.nan
    return moved


def _after(path: Path, offset: int, rows: int) -> int:
    """Byte behind that many lines."""
    with path.open("rb") as file:
        file.seek(offset)
        for _ in range(rows):
            file.readline()
        return file.tell()
