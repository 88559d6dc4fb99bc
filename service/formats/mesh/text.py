"""Vertices of OBJ and OFF files, in the order of the file."""

from __future__ import annotations

import re
from pathlib import Path

from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import MalformedFileError
from service.formats.text_table import Dialect, read_columns, read_head_lines

_OBJ = re.compile(rb"(?:\s*#[^\n]*\n)*\s*(?:v|vn|vt|o|g|s|f|mtllib|usemtl)[ \t]")
_OFF = re.compile(rb"(?:\s*#[^\n]*\n)*\s*(?:ST)?C?N?OFF\s")


def sniff_obj(head: bytes) -> bool:
    """Whether the first line that is no comment is an OBJ statement."""
    return _OBJ.match(head) is not None


def sniff_off(head: bytes) -> bool:
    """Whether the first line that is no comment begins with OFF, COFF, NOFF or the like."""
    return _OFF.match(head) is not None and b"BINARY" not in head[:80]


def read_obj(path: Path, limits: ReadLimits) -> DecodedCloud:
    """Read the lines "v x y z ..." of an OBJ file.

    Raises
    ------
    CloudFileError
        The file is malformed; the message names the line.
    """
    points = read_columns(path, 0, 1, (1, 2, 3), limits, dialect=Dialect(keyword="v"))
    if len(points) == 0:
        raise MalformedFileError("no line begins with 'v'; expected lines 'v x y z'")
    return DecodedCloud(points, "obj")


def read_off(path: Path, limits: ReadLimits) -> DecodedCloud:
    """Read the vertices of an OFF file.

    Raises
    ------
    CloudFileError
        The file is malformed; the message names the line.
    """
    words: list[str] = []
    lines = read_head_lines(path, limits)
    number = 0
    for number, line in enumerate(lines, 1):  # noqa: B007
        words += line.split("#")[0].split()
        if len(words) >= 4 or (len(words) >= 2 and not words[1].isdecimal()):
            break
    if len(words) != 4 or not all(word.isdecimal() and len(word) < 19 for word in words[1:]):
        raise MalformedFileError(
            f"line {number}: expected OFF and the numbers of vertices, faces and edges, "
            f"found {words[:5]}"
        )
    offset, count = sum(len(line) + 1 for line in lines[:number]), int(words[1])
    check_count(count, 6, path.stat().st_size - offset + 1, f"line {number}", limits)
    points = read_columns(path, offset, number + 1, (0, 1, 2), limits, rows=count)
    return DecodedCloud(points, "off")
