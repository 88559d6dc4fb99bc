"""Faces of a PLY file, cut into triangles."""

from __future__ import annotations

from array import array
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import CloudFileError, MalformedFileError
from service.formats.faces import check_face_count, check_faces, triangulate
from service.formats.memory_map import map_file
from service.formats.ply.header import PlyElement, PlyHeader
from service.formats.ply.rows import read_lists, read_rows

_LISTS = ("vertex_indices", "vertex_index")


def read_faces(
    path: Path, header: PlyHeader, limits: ReadLimits, *, warns_of_others: bool
) -> tuple[NDArray[np.int64] | None, tuple[str, ...]]:
    """Read the triangles (F, 3) and warnings; None without faces, or where they are damaged."""
    names = [element.name for element in header.elements]
    if "face" not in names or header.elements[names.index("face")].count == 0:
        strips = [name for name in names if name == "tristrips"]
        return None, ("the strips of triangles are not kept",) if strips else ()
    place = names.index("face")
    element = header.elements[place]
    lists = [item.name for item in element.properties if item.count_type]
    wanted = next((name for name in lists if name in _LISTS), None)
    try:
        if wanted is None:
            raise MalformedFileError(f"{element.count} faces with the lists {lists[:9]}")
        check_face_count(header.elements[names.index("vertex")].count, element.count, limits)
        read = _read_binary if header.order else _read_ascii
        corners, sizes = read(path, header, place, wanted, limits)
        count = header.elements[names.index("vertex")].count
        faces = check_faces(triangulate(corners, sizes), count)
    except CloudFileError as error:
        return None, (f"the faces are not kept: {error}",)
    others = [item.name for item in element.properties if item.name != wanted and warns_of_others]
    lost = ", ".join(repr(name[:40]) for name in others[:9])
    return faces, (f"properties of the faces are not kept: {lost}",) if others else ()


def skip_lines(path: Path, offset: int, count: int, line: int, limits: ReadLimits) -> int:
    """Return the offset after `count` lines.

    Raises
    ------
    MalformedFileError
        The file ends before, or a line is too long.
    """
    with path.open("rb") as file:
        file.seek(offset)
        for number in range(count):
            if not file.readline(limits.max_line_bytes).endswith(b"\n"):
                raise MalformedFileError(
                    f"line {line + number + 1}: the file ends, or the line is longer than "
                    f"{limits.max_line_bytes} bytes"
                )
        return file.tell()


def _read_binary(
    path: Path, header: PlyHeader, place: int, wanted: str, limits: ReadLimits
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    content, offset = map_file(path), header.size
    for element in header.elements[:place]:
        _, offset = read_rows(content, offset, element, header.order, ())
    corners, sizes = read_lists(content, offset, header.elements[place], header.order, wanted)
    return corners.astype(np.int64), sizes


def _read_ascii(
    path: Path, header: PlyHeader, place: int, wanted: str, limits: ReadLimits
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    element = header.elements[place]
    before = sum(item.count for item in header.elements[:place])
    offset = skip_lines(path, header.size, before, header.lines, limits)
    first = header.lines + before + 1
    corners, sizes = array("q"), array("q")
    with path.open("rb") as file:
        file.seek(offset)
        for number in range(first, first + element.count):
            try:
                found = _find_list(file.readline(limits.max_line_bytes).split(), element, wanted)
            except (ValueError, IndexError):
                raise MalformedFileError(f"line {number}: it is no face") from None
            corners.extend(found)
            sizes.append(len(found))
    return np.array(corners, np.int64), np.array(sizes, np.int64)


def _find_list(words: list[bytes], element: PlyElement, wanted: str) -> list[int]:
    """Return the numbers of the list `wanted` in the words of a row."""
    at = 0
    for item in element.properties:
        length = int(words[at]) if item.count_type else 1
        start = at + 1 if item.count_type else at
        if item.name == wanted:
            numbers = words[start : start + length]
            if len(numbers) < length:
                raise IndexError
            return [int(word) for word in numbers]
        at = start + length
    raise IndexError
