"""Colours and faces of OBJ and OFF files."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB
from service.formats.decoded_cloud import DecodedCloud, ReadLimits
from service.formats.errors import CloudFileError
from service.formats.faces import check_faces, triangulate
from service.formats.text_table import Dialect, read_columns

_MAX_LINE_BYTES = 1 << 16


def read_obj_attributes(path: Path, count: int, limits: ReadLimits) -> DecodedCloud:
    """Read the colours behind the `count` vertices and the faces; warn of what is not kept."""
    colors: dict[str, NDArray[np.generic]] = {}
    if _has_colors(path):
        try:
            table = read_columns(path, 0, 1, (4, 5, 6), limits, dialect=Dialect(keyword="v"))
            colors = dict(zip(RGB, table.T, strict=True)) if len(table) == count else {}
        except CloudFileError:
            colors = {}
    seen = 0
    others: set[str] = set()
    corners: list[int] = []
    sizes: list[int] = []
    faces: NDArray[np.int64] | None = None
    warnings: tuple[str, ...] = ()
    try:
        for words in _lines(path):
            if words[0] == "v":
                seen += 1
            elif words[0] == "f":
                found = [int(word.split("/", 1)[0]) for word in words[1:]]
                corners += [seen + item if item < 0 else item - 1 for item in found]
                sizes.append(len(found))
            elif words[0] in ("vn", "vt", "l", "p"):
                others.add(words[0])
        triangles = triangulate(np.array(corners, np.int64), np.array(sizes, np.int64))
        faces = check_faces(triangles, count) if len(triangles) else None
    except (ValueError, OverflowError) as error:
        warnings = (f"the faces are not kept: {error}"[:200],)
    if others:
        warnings += (f"lines of {', '.join(sorted(others))} are not kept",)
    return DecodedCloud(np.empty((0, 3)), "obj", warnings, attributes=colors, faces=faces)


def read_off_faces(
    path: Path, offset: int, vertices: int, count: int
) -> tuple[NDArray[np.int64] | None, tuple[str, ...]]:
    """Read the faces after the vertices, which begin at `offset`."""
    rows = islice(_lines(path, offset), vertices, vertices + count)
    corners: list[int] = []
    sizes: list[int] = []
    try:
        for words in rows:
            size = int(words[0])
            corners += [int(word) for word in words[1 : size + 1]]
            sizes.append(size)
        if sum(sizes) != len(corners):
            return None, ("the faces are not kept: a face has fewer corners than it announces",)
        triangles = triangulate(np.array(corners, np.int64), np.array(sizes, np.int64))
        return (check_faces(triangles, vertices) if len(triangles) else None), ()
    except (ValueError, OverflowError) as error:
        return None, (f"the faces are not kept: {error}"[:200],)


def _lines(path: Path, offset: int = 0) -> Iterator[list[str]]:
    """Yield the words of the lines that are neither blank nor comments."""
    with path.open("rb") as file:
        file.seek(offset)
        while line := file.readline(_MAX_LINE_BYTES):
            words = line.decode("latin1").split("#", 1)[0].split()
            if words:
                yield words


def _has_colors(path: Path) -> bool:
    """Whether the first vertex has six numbers."""
    return next((len(words) == 7 for words in _lines(path) if words[0] == "v"), False)
