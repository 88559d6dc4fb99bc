"""Vertices of OFF files, in the order of the file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.announced_rows import AnnouncedRows
from service.formats.colors import RGB
from service.formats.decoded_cloud import DecodedCloud, ReadLimits, check_count
from service.formats.errors import MalformedFileError
from service.formats.faces import LARGE_MESH_WARNING
from service.formats.mesh.text_faces import read_off_faces
from service.formats.numerals import significant_line
from service.formats.text_block import read_head_lines, skip_lines

_KEYWORD = re.compile(r"(?:(?:ST)?(C?)(N?)OFF|off)(\d{0,18})")
"""Keyword of OFF, in some files joined to the number of vertices; C stands for colours, N for
normals."""
_NORMALS = ("nx", "ny", "nz")


def sniff(head: bytes) -> bool:
    """Whether the first line that is no comment begins with OFF, COFF, NOFF or the like."""
    words = significant_line(head).decode("latin1").split(maxsplit=2)
    return bool(words) and _KEYWORD.fullmatch(words[0]) is not None and words[1:2] != ["BINARY"]


def is_off_without_keyword(first_line: str, rows: int) -> bool:
    """Whether a text of so many rows begins with the numbers of its vertices and faces."""
    words = first_line.split("#")[0].split()
    if len(words) not in (2, 3) or not all(w.isdecimal() and len(w) < 10 for w in words):
        return False
    vertices, faces = int(words[0]), int(words[1])
    return vertices > 2 and faces > 0 and rows == vertices + faces + (len(words) == 3)


@dataclass(frozen=True, slots=True)
class _Vertices:
    """Where the vertices are, and what is read of them."""

    rows: AnnouncedRows
    names: tuple[str, ...]
    """Attributes behind the coordinates."""
    lost: int
    """Numbers behind them, which have no name."""

    def to_cloud(self, table: NDArray[np.float64]) -> DecodedCloud:
        """Make a cloud of the numbers that were read."""
        kept: dict[str, NDArray[np.generic]] = dict(zip(self.names, table.T[3:], strict=True))
        if RGB[0] in kept:
            kept |= _to_bytes({name: kept[name] for name in RGB})
        return DecodedCloud(table[:, :3], "off", attributes=kept)

    def warnings(self, limits: ReadLimits) -> tuple[str, ...]:
        """Describe what was unusual about the rows, and what was not kept."""
        lost = f"{self.lost} columns behind the coordinates are not kept"
        return self.rows.warnings(limits) + ((lost,) if self.lost else ())


def read(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> DecodedCloud:
    """Read the vertices of an OFF file; `attributes` adds the normals and colours.

    Raises
    ------
    CloudFileError
        The file is malformed; the message names the line.
    """
    vertices = _find_vertices(path, limits, attributes=attributes)
    rows = vertices.rows
    cloud = vertices.to_cloud(rows.read(limits))
    warnings = vertices.warnings(limits)
    if not faces:
        return replace(cloud, warnings=warnings)
    triangles, more = read_off_faces(path, rows.text.start, rows.count, rows.after, limits)
    return replace(cloud, warnings=warnings + more, faces=triangles)


def read_pieces(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read` does, in consecutive pieces; `faces` are not kept."""
    vertices = _find_vertices(path, limits, attributes=attributes)
    for table in vertices.rows.read_pieces(limits):
        yield vertices.to_cloud(table)
    warnings = (LARGE_MESH_WARNING,) if faces and vertices.rows.after else ()
    yield DecodedCloud(np.empty((0, 3)), "off", vertices.warnings(limits) + warnings)


def _find_vertices(path: Path, limits: ReadLimits, *, attributes: bool) -> _Vertices:
    """Find the vertices, and count the faces after them."""
    counts: list[str] = []
    names: tuple[str, ...] = ()
    lines = read_head_lines(path, limits)
    number = 0
    for number, line in enumerate(lines, 1):  # noqa: B007
        words = line.split("#")[0].split()
        if words and (keyword := _KEYWORD.fullmatch(words[0])):
            names = (_NORMALS if keyword[2] else ()) + (RGB if keyword[1] else ())
            words = [keyword[3], *words[1:]] if keyword[3] else words[1:]
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
    further = _count_further(lines[number:]) if attributes and count else 0
    names = names if attributes and len(names) <= further else ()
    columns = range(3 + len(names))
    rows = AnnouncedRows.at(path, offset, number + 1, columns, count, int(counts[1]))
    return _Vertices(rows, names, further - len(names))


def _count_further(lines: list[str]) -> int:
    """Count the numbers behind the coordinates of the first vertex."""
    rows = (line.split("#")[0].split() for line in lines)
    return max(0, len(next(filter(None, rows), [])) - 3)


def _to_bytes(colors: dict[str, NDArray[np.generic]]) -> dict[str, NDArray[np.generic]]:
    """Return whole colours up to 255 as bytes, others as they are."""
    values = np.stack([*colors.values()]).astype(np.float64)
    is_byte = bool(((values >= 0) & (values <= 255) & (values == np.rint(values))).all())
    if not is_byte or values.max(initial=0) <= 1:
        return colors
    return {name: column.astype(np.uint8) for name, column in colors.items()}
