"""The header of a PCD file: which fields follow, how many points, in which encoding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from service.formats.decoded_cloud import Limits
from service.formats.errors import FileLimitError, MalformedFileError, TruncatedFileError

_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS")
_TYPES = {"F4", "F8", "I1", "I2", "I4", "I8", "U1", "U2", "U4", "U8"}


@dataclass(frozen=True, slots=True)
class Header:
    fields: tuple[str, ...]
    types: tuple[str, ...]  # NumPy's codes: "<f4"
    counts: tuple[int, ...]
    points: int
    data: str
    viewpoint: tuple[float, ...] | None
    size: int  # bytes
    lines: int

    @property
    def row(self) -> np.dtype[np.void]:
        """Layout of a point; fields are named by their place, for names may repeat ("_")."""
        return np.dtype(
            [
                (str(i), t, (n,))
                for i, (t, n) in enumerate(zip(self.types, self.counts, strict=True))
            ]
        )


def parse_header(head: bytes, limits: Limits) -> Header:
    """Parse the header at the start of ``head``.

    Raises
    ------
    CloudFileError
        With the line at fault.
    """
    values: dict[str, list[str]] = {}
    offset = 0
    for number in range(1, limits.max_header_lines + 1):
        end = head.find(b"\n", offset)
        if end < 0:
            break
        key, *rest = head[offset:end].decode("latin1").split() or ["#"]
        offset = end + 1
        if key.startswith("#"):
            continue
        key = "FIELDS" if key == "COLUMNS" else key
        if key == "DATA":
            return _header(values, " ".join(rest), offset, number, limits)
        if key not in _KEYS or key in values:
            raise MalformedFileError(f"line {number}: {key[:40]!r} in a PCD header")
        values[key] = rest
    if len(head) < limits.max_header_bytes and end < 0:
        raise TruncatedFileError("the file ends before the DATA line of the PCD header")
    raise FileLimitError(
        f"no DATA line in the first {limits.max_header_lines} lines "
        f"or {limits.max_header_bytes} bytes"
    )


def _header(
    values: dict[str, list[str]], data: str, size: int, lines: int, limits: Limits
) -> Header:
    if data not in ("ascii", "binary", "binary_compressed"):
        raise MalformedFileError(f"line {lines}: DATA {data[:40]!r}")
    fields = tuple(values.get("FIELDS", ()))
    if len(fields) > limits.max_properties:
        raise FileLimitError(f"{len(fields)} FIELDS; at most {limits.max_properties} are read")
    counts = tuple(_integers(values, "COUNT", [1] * len(fields)))
    types = [
        f"{kind}{width}"
        for kind, width in zip(values.get("TYPE", ()), values.get("SIZE", ()), strict=False)
    ]
    if not len(fields) == len(types) == len(counts):
        raise MalformedFileError(
            f"FIELDS, SIZE, TYPE and COUNT differ: {len(fields)}, {len(values.get('SIZE', ()))}, "
            f"{len(values.get('TYPE', ()))}, {len(counts)} entries"
        )
    if not _TYPES.issuperset(types) or not all(0 < n <= 1 << 16 for n in counts):
        raise MalformedFileError(f"TYPE, SIZE or COUNT out of range: {types[:9]}, {counts[:9]}")
    return Header(
        fields,
        tuple(f"<{item.lower()}" for item in types),
        counts,
        _point_count(values),
        data,
        _viewpoint(values),
        size,
        lines,
    )


def _point_count(values: dict[str, list[str]]) -> int:
    (width,) = _integers(values, "WIDTH", [0])
    (height,) = _integers(values, "HEIGHT", [1])
    (points,) = _integers(values, "POINTS", [width * height])
    if "WIDTH" in values and points != width * height:
        raise MalformedFileError(f"POINTS {points}, but WIDTH x HEIGHT is {width * height}")
    return points


def _integers(values: dict[str, list[str]], key: str, default: list[int]) -> list[int]:
    if key not in values:
        return default
    words = values[key]
    if len(words) != max(1, len(default)) or not all(w.isdecimal() and len(w) < 19 for w in words):
        raise MalformedFileError(f"{key} {' '.join(words)[:60]}: expected {len(default)} counts")
    return [int(word) for word in words]


def _viewpoint(values: dict[str, list[str]]) -> tuple[float, ...] | None:
    if "VIEWPOINT" not in values:
        return None
    try:
        numbers = tuple(float(word) for word in values["VIEWPOINT"])
    except ValueError:
        numbers = ()
    if len(numbers) != 7:
        raise MalformedFileError(f"VIEWPOINT {' '.join(values['VIEWPOINT'])[:60]}: not 7 numbers")
    return numbers
