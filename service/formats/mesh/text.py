"""Vertices of OBJ and OFF files, in the order of the file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from service.formats.announced_rows import AnnouncedRows
from service.formats.colors import RGB
from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import MalformedFileError
from service.formats.faces import LARGE_MESH_WARNING
from service.formats.mesh.text_faces import (
    has_colors,
    read_obj_colors,
    read_obj_faces,
    read_off_faces,
)
from service.formats.numerals import significant_line
from service.formats.text_block import TextBlock, read_head_lines, skip_lines
from service.formats.text_cleaner import Dialect, TableCleaner
from service.formats.text_table import iter_columns, read_columns

_OBJ_KEYWORDS = {b"v", b"vn", b"vt", b"vp", b"o", b"g", b"s", b"f", b"l", b"mtllib", b"usemtl"}
_VERTICES = Dialect(keyword="v")
_OFF_WORD = re.compile(r"(?:(?:ST)?C?N?OFF|off)(\d{0,18})")
"""Keyword of OFF, in some files joined to the number of vertices."""


def sniff_obj(head: bytes) -> bool:
    """Whether the first line that is no comment is an OBJ statement."""
    if b"\0" in head:
        return False
    words = significant_line(head).split()
    if words[:1] in ([b"g"], [b"o"], [b"s"]):
        return True
    return len(words) > 1 and words[0] in _OBJ_KEYWORDS


def sniff_off(head: bytes) -> bool:
    """Whether the first line that is no comment begins with OFF, COFF, NOFF or the like."""
    words = significant_line(head).decode("latin1").split(maxsplit=2)
    return bool(words) and _OFF_WORD.fullmatch(words[0]) is not None and words[1:2] != ["BINARY"]


def is_off_without_keyword(first_line: str, rows: int) -> bool:
    """Whether a text of so many rows begins with the numbers of its vertices and faces."""
    words = first_line.split("#")[0].split()
    if len(words) not in (2, 3) or not all(w.isdecimal() and len(w) < 10 for w in words):
        return False
    vertices, faces = int(words[0]), int(words[1])
    return vertices > 2 and faces > 0 and rows == vertices + faces + (len(words) == 3)


def read_obj(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> DecodedCloud:
    """Read the lines "v x y z ..." of an OBJ file; `attributes` adds the colours.

    Raises
    ------
    CloudFileError
        The file is malformed; the message names the line.
    """
    cleaner = TableCleaner(_VERTICES, (1, 2, 3))
    points = read_columns(path, 0, 1, (1, 2, 3), limits, dialect=_VERTICES, cleaner=cleaner)
    if len(points) == 0:
        raise MalformedFileError("no line begins with 'v'; expected lines 'v x y z'")
    cloud = DecodedCloud(points, "obj", cleaner.warnings())
    if attributes:
        cloud = replace(cloud, attributes=read_obj_colors(path, len(points), limits))
    if faces:
        triangles, warnings = read_obj_faces(path, len(points), limits, warns_of_others=attributes)
        cloud = replace(cloud, faces=triangles, warnings=cloud.warnings + warnings)
    return cloud


def read_obj_pieces(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read_obj` does, in consecutive pieces; `faces` are not kept."""
    columns = (1, 2, 3, 4, 5, 6) if attributes and has_colors(path) else (1, 2, 3)
    text = TextBlock(path, 0, path.stat().st_size, 1)
    cleaner = TableCleaner(_VERTICES, columns)
    for table in iter_columns(text, columns, limits, dialect=_VERTICES, cleaner=cleaner):
        kept = dict(zip(RGB, table.T[3:], strict=False))
        yield DecodedCloud(table[:, :3], "obj", attributes=kept)
    warnings = cleaner.warnings() + ((LARGE_MESH_WARNING,) if faces else ())
    yield DecodedCloud(np.empty((0, 3)), "obj", warnings)


def read_off(path: Path, limits: ReadLimits, *, faces: bool = False) -> DecodedCloud:
    """Read the vertices of an OFF file.

    Raises
    ------
    CloudFileError
        The file is malformed; the message names the line.
    """
    rows = _find_rows(path, limits)
    points, warnings = rows.read(limits), rows.warnings(limits)
    if not faces:
        return DecodedCloud(points, "off", warnings)
    triangles, more = read_off_faces(path, rows.text.start, rows.count, rows.after, limits)
    return DecodedCloud(points, "off", warnings + more, faces=triangles)


def read_off_pieces(
    path: Path, limits: ReadLimits, *, faces: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read_off` does, in consecutive pieces; `faces` are not kept."""
    rows = _find_rows(path, limits)
    for points in rows.read_pieces(limits):
        yield DecodedCloud(points, "off")
    warnings = (LARGE_MESH_WARNING,) if faces and rows.after else ()
    yield DecodedCloud(np.empty((0, 3)), "off", rows.warnings(limits) + warnings)


def _find_rows(path: Path, limits: ReadLimits) -> AnnouncedRows:
    """Find the vertices, and count the faces after them."""
    counts: list[str] = []
    lines = read_head_lines(path, limits)
    number = 0
    for number, line in enumerate(lines, 1):  # noqa: B007
        words = line.split("#")[0].split()
        if words and (keyword := _OFF_WORD.fullmatch(words[0])):
            words = [keyword[1], *words[1:]] if keyword[1] else words[1:]
        counts += words
        if counts:
            break
    if len(counts) not in (2, 3) or not all(w.isdecimal() and len(w) < 19 for w in counts):
        raise MalformedFileError(
            f"line {number}: expected OFF and the numbers of vertices, faces and edges, "
            f"found {counts[:5]}"
        )
    offset, count = skip_lines(path, 0, number), int(counts[0])
    check_count(count, 6, path.stat().st_size - offset + 1, f"line {number}", limits)
    return AnnouncedRows.at(path, offset, number + 1, (0, 1, 2), count, int(counts[1]))
