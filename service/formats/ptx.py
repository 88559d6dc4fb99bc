"""Leica PTX files: gridded scans in ASCII, each with its pose in a common frame."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import MalformedFileError
from service.formats.multi_scan import select_scans
from service.formats.text_table import read_columns

_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_LINE = rb"[ \t]*\r?\n"
_HEADER = re.compile(
    rb"[ \t]*(\d{1,9})" + _LINE + rb"[ \t]*(\d{1,9})" + _LINE
    + rb"((?:[ \t]*" + rb"[ \t]+".join([_NUMBER] * 3) + _LINE + rb"){4})"
    + rb"((?:[ \t]*" + rb"[ \t]+".join([_NUMBER] * 4) + _LINE + rb"){4})"
)  # fmt: skip
_HEADER_LINES = 10
_MAX_SCANS = 1000


def sniff(head: bytes) -> bool:
    """Whether the bytes begin with two counts, four lines of three and four of four numbers."""
    return _HEADER.match(head) is not None


def read(path: Path, limits: ReadLimits, scan: int | None) -> DecodedCloud:
    """Read a scan (counted from 0) or all scans, moved by their matrices.

    The matrices of the file multiply row vectors from the right. Points at (0, 0, 0) are missing
    returns and become NaN.

    Raises
    ------
    CloudFileError
        The file is damaged or has no such scan; the message names the line.
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
        if found is None or len(scans) >= _MAX_SCANS:
            raise MalformedFileError(f"line {line}: no header of a PTX scan")
        count = int(found[1]) * int(found[2])
        total = count + sum(map(len, scans))
        check_count(total, 0, 0, f"line {line}", limits)
        check_count(count, 6, size - offset, f"line {line}", limits)
        offset, line = offset + found.end(), line + _HEADER_LINES
        points = read_columns(path, offset, line, (0, 1, 2), limits, rows=count)
        scans.append(_transform(points, np.array(found[4].split(), float).reshape(4, 4)))
        offset, line = _skip_lines(path, offset, count), line + count
    wanted, warnings = select_scans(len(scans), scan)
    return DecodedCloud(np.concatenate([scans[i] for i in wanted]), "ptx", warnings)


def _transform(points: NDArray[np.float64], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    missing = ~points.any(axis=1)
    moved = points @ matrix[:3, :3] + matrix[3, :3]
    moved[missing] = np.nan
    return moved


def _skip_lines(path: Path, offset: int, rows: int) -> int:
    """Return the offset after this many lines."""
    with path.open("rb") as file:
        file.seek(offset)
        for _ in range(rows):
            file.readline()
        return file.tell()
