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
_BLOCK_WORDS = 30_000
"""Corners that are converted at once."""
_NORMAL_LINE = b"\nvn "


@dataclass(slots=True)
class ObjFaces:
    """The corners of all faces, one face after the other."""

    corners: array[int] = field(default_factory=lambda: array("q"))
    """Indices of vertices."""
    normals: array[int] = field(default_factory=lambda: array("q"))
    """Index of the normal of each corner, if all corners have one; else there are fewer."""
    sizes: array[int] = field(default_factory=lambda: array("q"))
    """Number of corners of each face."""
    has_partial_normals: bool = False
    """Whether some corners have a normal, and some beside them have none."""
    vertices: int = 0
    """Vertices before the next face."""
    listed_normals: int = 0
    """Normals before the next face."""
    triangles: NDArray[np.int64] | None = None
    warnings: tuple[str, ...] = ()
    """Why there are no triangles, and what else is not kept."""
    _words: list[str] = field(default_factory=list)
    """Corners that are not converted yet, behind equal numbers of vertices and normals."""

    def add(self, words: list[str]) -> bool:
        """Add a face; return whether it is time to convert."""
        self._words += words
        self.sizes.append(len(words))
        return len(self._words) >= _BLOCK_WORDS

    def convert(self) -> None:
        """Convert the corners that were added: a vertex, and perhaps a texture and a normal."""
        if not self._words:
            return
        words, self._words = self._words, []
        slashes = {word.count("/") for word in words}
        if len(slashes) != 1:
            words, width = [word.split("/", 1)[0] for word in words], 1
            self.has_partial_normals |= 2 in slashes
        else:
            words, width = "/".join(words).split("/"), slashes.pop() + 1
        self.corners.extend(_to_places(words[::width], self.vertices))
        if width == 3 and "" not in words[2::3]:
            self.normals.extend(_to_places(words[2::3], self.listed_normals))


def _to_places(numbers: list[str], count: int) -> list[int]:
    """Return the places of numbers from 1; negative ones count back from the last of `count`."""
    found = list(map(int, numbers))
    return [count + item if item < 0 else item - 1 for item in found]


def read_faces(path: Path, count: int, limits: ReadLimits, *, warns_of_others: bool) -> ObjFaces:
    """Read the faces at the `count` vertices, with warnings of what is not kept."""
    faces = ObjFaces()
    others: set[str] = set()
    try:
        for words in iter_words(path):
            if words[0] == "f":
                if faces.add(words[1:]):
                    faces.convert()
                    check_face_count(count, len(faces.sizes), limits)
            elif words[0] in ("v", "vn"):
                faces.convert()
                faces.vertices += words[0] == "v"
                faces.listed_normals += words[0] == "vn"
            elif words[0] in ("vt", "l", "p"):
                others.add(words[0])
        faces.convert()
        check_face_count(count, len(faces.sizes), limits)
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
    if not faces.listed_normals:
        return {}, ()
    try:
        found = read_columns(path, 0, 1, (1, 2, 3), limits, dialect=Dialect(keyword="vn"))
    except CloudFileError as error:
        return {}, (f"{_LOST}: {error}"[:200],)
    if len(faces.normals) == 0 and not faces.has_partial_normals and len(found) == count:
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
