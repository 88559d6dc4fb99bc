"""The header of a PCD file: fields, number of points and encoding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import FileLimitError, MalformedFileError, TruncatedFileError
from service.formats.text_encoding import decode_line, find_line_end

_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS")
_TYPES = {"F4", "F8", "I1", "I2", "I4", "I8", "U1", "U2", "U4", "U8"}


@dataclass(frozen=True, slots=True)
class PcdHeader:
    """The parsed header."""

    fields: tuple[str, ...]
    """Names; padding is called "_"."""
    types: tuple[str, ...]
    """NumPy's type of each field: "<f4"."""
    counts: tuple[int, ...]
    """Numbers of each field for a point."""
    points: int
    """Number of points."""
    data: str
    """Encoding: "ascii", "binary" or "binary_compressed"."""
    viewpoint: tuple[float, ...] | None
    """Sensor pose: tx, ty, tz, qw, qx, qy, qz."""
    size: int
    """Bytes of the header."""
    lines: int
    """Lines of the header."""

    @property
    def row(self) -> np.dtype[np.void]:
        """Layout of a point; fields are called by their index because names may repeat."""
        return np.dtype(
            [
                (str(i), t, (n,))
                for i, (t, n) in enumerate(zip(self.types, self.counts, strict=True))
            ]
        )


def parse_header(head: bytes, limits: ReadLimits) -> PcdHeader:
    """Parse the header at the start of ``head``.

    Raises
    ------
    CloudFileError
        The header is malformed or too long; the message names the line.
    """
    values: dict[str, list[str]] = {}
    offset, line_end = 0, find_line_end(head)
    for number in range(1, limits.max_header_lines + 1):
        end = head.find(line_end, offset)
        if end < 0:
            break
        key, *rest = decode_line(head[offset:end]).split() or ["#"]
        offset = end + 1
        if key.startswith("#"):
            continue
        key = key.upper()
        key = "FIELDS" if key == "COLUMNS" else key
        if key == "DATA":
            return _build_header(values, " ".join(rest).lower(), offset, number, limits)
        if key not in _KEYS or key in values:
            raise MalformedFileError(
                f"line {number}: {key[:40]!r} is unknown or repeated; expected one of "
                f"{', '.join(_KEYS)}, DATA"
            )
        values[key] = rest
    if len(head) < limits.max_header_bytes and end < 0:
        raise TruncatedFileError("the file ends before the DATA line of the PCD header")
    raise FileLimitError(
        f"no DATA line in the first {limits.max_header_lines} lines "
        f"or {limits.max_header_bytes} bytes"
    )


def _build_header(
    values: dict[str, list[str]], data: str, size: int, lines: int, limits: ReadLimits
) -> PcdHeader:
    if data not in ("ascii", "binary", "binary_compressed"):
        raise MalformedFileError(
            f"line {lines}: DATA {data[:40]!r}; expected ascii, binary or binary_compressed"
        )
    fields = tuple(values.get("FIELDS", ()))
    if len(fields) > limits.max_properties:
        raise FileLimitError(f"{len(fields)} FIELDS; the limit is {limits.max_properties}")
    counts = tuple(_parse_counts(values, "COUNT", [1] * len(fields)))
    if data == "ascii" and not {"SIZE", "TYPE"} & set(values):
        values |= {"SIZE": ["4"] * len(fields), "TYPE": ["F"] * len(fields)}
    types = [
        f"{kind.upper()}{width}"
        for kind, width in zip(values.get("TYPE", ()), values.get("SIZE", ()), strict=False)
    ]
    if not len(fields) == len(types) == len(counts):
        raise MalformedFileError(
            f"the numbers of entries of FIELDS, SIZE, TYPE and COUNT differ: {len(fields)}, "
            f"{len(values.get('SIZE', ()))}, {len(values.get('TYPE', ()))}, {len(counts)}"
        )
    if not _TYPES.issuperset(types) or not all(0 < n <= 1 << 16 for n in counts):
        raise MalformedFileError(
            f"TYPE, SIZE or COUNT out of range: {types[:9]}, {counts[:9]}; expected types of "
            f"{', '.join(sorted(_TYPES))} and counts of 1 to 65536"
        )
    return PcdHeader(
        fields,
        tuple(f"<{item.lower()}" for item in types),
        counts,
        _parse_point_count(values),
        data,
        _parse_viewpoint(values),
        size,
        lines,
    )


def _parse_point_count(values: dict[str, list[str]]) -> int:
    if not {"POINTS", "WIDTH"} & set(values):
        raise MalformedFileError("the header has neither POINTS nor WIDTH; expected a count")
    (width,) = _parse_counts(values, "WIDTH", [0])
    (height,) = _parse_counts(values, "HEIGHT", [1])
    (points,) = _parse_counts(values, "POINTS", [width * height])
    if width * height and points != width * height:
        raise MalformedFileError(f"POINTS {points}, but WIDTH x HEIGHT is {width * height}")
    return points


def _parse_counts(values: dict[str, list[str]], key: str, default: list[int]) -> list[int]:
    if key not in values:
        return default
    words = values[key]
    if len(words) != max(1, len(default)) or not all(w.isdecimal() and len(w) < 19 for w in words):
        raise MalformedFileError(
            f"{key} {' '.join(words)[:60]}: expected whole numbers, one for each field"
        )
    return [int(word) for word in words]


def _parse_viewpoint(values: dict[str, list[str]]) -> tuple[float, ...] | None:
    if "VIEWPOINT" not in values:
        return None
    try:
        numbers = tuple(float(word) for word in values["VIEWPOINT"])
    except ValueError:
        numbers = ()
    if len(numbers) != 7:
        raise MalformedFileError(
            f"VIEWPOINT {' '.join(values['VIEWPOINT'])[:60]}: expected 7 numbers"
        )
    return numbers
