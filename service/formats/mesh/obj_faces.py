"""Faces of OBJ files, and the normals of the vertices, which the faces assign."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import ReadLimits
from service.formats.errors import CloudFileError
from service.formats.faces import check_face_count
from service.formats.mesh.text_faces import iter_words, to_faces
from service.formats.text_block import TextBlock
from service.formats.text_cleaner import Dialect
from service.formats.text_table import read_columns

NORMALS = ("nx", "ny", "nz")
_LOST = "the normals (vn) are not kept"
_NORMAL_LINE = b"\nvn "


@dataclass(slots=True)
class ObjFaces:
    """The corners of all faces, one face after the other."""

    corners: array[int] = field(default_factory=lambda: array("q"))
    """Indices of vertices."""
    normals: array[int] = field(default_factory=lambda: array("q"))
    """Index of the normal of each corner, if all corners have one; else shorter."""
    sizes: array[int] = field(default_factory=lambda: array("q"))
    """Number of corners of each face."""
    triangles: NDArray[np.int64] | None = None
    warnings: tuple[str, ...] = ()
    """Why there are no triangles, and what else is not kept."""

    def add(self, words: list[str], vertices: int, normals: int) -> None:
        """Add a face behind so many vertices and normals; negative numbers count from there."""
        parts = [word.split("/") for word in words]
        found = [int(part[0]) for part in parts]
        self.corners.extend(vertices + item if item < 0 else item - 1 for item in found)
        self.sizes.append(len(found))
        if normals and all(len(part) == 3 for part in parts):
            chosen = [int(part[2]) for part in parts]
            self.normals.extend(normals + item if item < 0 else item - 1 for item in chosen)


def read_faces(path: Path, count: int, limits: ReadLimits, *, warns_of_others: bool) -> ObjFaces:
    """Read the faces at the `count` vertices, with warnings of what is not kept."""
    faces = ObjFaces()
    vertices, normals = 0, 0
    others: set[str] = set()
    try:
        for words in iter_words(path):
            if words[0] == "v":
                vertices += 1
            elif words[0] == "vn":
                normals += 1
            elif words[0] == "f":
                faces.add(words[1:], vertices, normals)
                check_face_count(count, len(faces.sizes), limits)
            elif words[0] in ("vt", "l", "p"):
                others.add(words[0])
        faces.triangles = to_faces(faces.corners, faces.sizes, count)
    except (ValueError, OverflowError) as error:
        faces.warnings = (f"the faces are not kept: {error}"[:200],)
    if others and warns_of_others:
        faces.warnings += (f"lines of {', '.join(sorted(others))} are not kept",)
    return faces


def read_normals(
    path: Path, count: int, faces: ObjFaces, limits: ReadLimits
) -> tuple[dict[str, NDArray[np.generic]], tuple[str, ...]]:
    """Read the normal of each of the `count` vertices.

    As many normals as vertices are in the order of these, unless faces assign them otherwise.

    Returns
    -------
    tuple[dict[str, NDArray[np.generic]], tuple[str, ...]]
        Zero for vertices without one, and warnings of normals that are not kept.
    """
    try:
        found = read_columns(path, 0, 1, (1, 2, 3), limits, dialect=Dialect(keyword="vn"))
    except CloudFileError as error:
        return {}, (f"{_LOST}: {error}"[:200],)
    if len(found) == 0:
        return {}, ()
    if len(faces.normals) == 0 and len(found) == count:
        return dict(zip(NORMALS, found.T, strict=True)), ()
    corners, chosen = (np.array(items, np.int64) for items in (faces.corners, faces.normals))
    if faces.triangles is None or len(chosen) != len(corners):
        return {}, (f"{_LOST}: not every corner of the faces has one",)
    if not _are_places(chosen, len(found)) or not _are_places(corners, count):
        return {}, (f"{_LOST}: a face refers to one that does not exist",)
    is_in_order = len(found) == count and np.array_equal(chosen, corners)
    normals = found.copy() if is_in_order else np.zeros((count, 3))
    normals[corners] = found[chosen]
    if not np.array_equal(normals[corners], found[chosen], equal_nan=True):
        return {}, (f"{_LOST}: some vertices have several, one for each face",)
    return dict(zip(NORMALS, normals.T, strict=True)), ()


def _are_places(numbers: NDArray[np.int64], count: int) -> bool:
    """Whether all numbers are those of `count` things, and there are some."""
    return len(numbers) > 0 and bool(numbers.min() >= 0 and numbers.max() < count)


def warn_of_normals(path: Path) -> tuple[str, ...]:
    """Name the normals of a file that is read in pieces, which are not kept."""
    text = TextBlock(path, 0, path.stat().st_size, 1)
    has_normals = any(_NORMAL_LINE in chunk for chunk in text.chunks())
    return (f"{_LOST}, because the file is large",) if has_normals else ()
