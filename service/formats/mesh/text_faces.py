"""Colours and faces of OBJ and OFF files."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB
from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import CloudFileError
from service.formats.faces import check_face_count, check_faces, triangulate
from service.formats.text_cleaner import Dialect
from service.formats.text_table import read_columns

_MAX_LINE_BYTES = 1 << 16


def read_obj_colors(path: Path, count: int, limits: ReadLimits) -> dict[str, NDArray[np.generic]]:
    """Read the colours behind the `count` vertices, where each vertex has them."""
    if not has_colors(path):
        return {}
    try:
        table = read_columns(path, 0, 1, (4, 5, 6), limits, dialect=Dialect(keyword="v"))
    except CloudFileError:
        return {}
    return dict(zip(RGB, table.T, strict=True)) if len(table) == count else {}


def read_off_faces(
    path: Path, offset: int, vertices: int, count: int, limits: ReadLimits
) -> tuple[NDArray[np.int64] | None, tuple[str, ...]]:
    """Read the faces after the vertices, which begin at `offset`."""
    rows = islice(iter_words(path, offset), vertices, vertices + count)
    corners, sizes = array("q"), array("q")
    try:
        check_face_count(vertices, count, limits)
        for words in rows:
            size = int(words[0])
            corners.extend(int(word) for word in words[1 : size + 1])
            sizes.append(size)
        if sum(sizes) != len(corners):
            return None, ("the faces are not kept: a face has fewer corners than it announces",)
        return to_faces(corners, sizes, vertices), ()
    except (ValueError, OverflowError) as error:
        return None, (f"the faces are not kept: {error}"[:200],)


def to_faces(corners: array[int], sizes: array[int], count: int) -> NDArray[np.int64] | None:
    """Return the triangles at `count` vertices; None without any."""
    triangles = triangulate(np.array(corners, np.int64), np.array(sizes, np.int64))
    return check_faces(triangles, count) if len(triangles) else None


def iter_words(path: Path, offset: int = 0) -> Iterator[list[str]]:
    """Yield the words of the lines that are neither blank nor comments."""
    with path.open("rb") as file:
        file.seek(offset)
        while line := file.readline(_MAX_LINE_BYTES):
            words = line.decode("latin1").split("#", 1)[0].split()
            if words:
                yield words


def has_colors(path: Path) -> bool:
    """Whether the first vertex has six numbers."""
    return _count_behind(path) == len(RGB)


def warn_of_numbers(path: Path) -> tuple[str, ...]:
    """Tell of numbers behind the coordinates of the first vertex that are neither colours nor 1."""
    count = _count_behind(path)
    if count in (0, 1, len(RGB)):  # one is the weight of a control point
        return ()
    return (f"{count} numbers behind the coordinates are not kept; expected 3, the colours",)


def _count_behind(path: Path) -> int:
    """Count the numbers behind the coordinates of the first vertex."""
    return next((len(words) - 4 for words in iter_words(path) if words[0] == "v"), 0)
