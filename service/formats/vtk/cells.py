"""Cells of VTK as triangles: polygons, strips, and the outside of solid cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from service.formats.errors import MalformedFileError, UnsupportedFileError
from service.formats.faces import check_faces, triangulate

Corners = NDArray[np.int64]
_STRIP, _POLYGON = 6, 7
_WITHOUT_AREA = frozenset((0, 1, 2, 3, 4, 21, 35))
"""Empty cells, points and lines."""
_FLAT = {5: (0, 1, 2), 8: (0, 1, 3, 2), 9: (0, 1, 2, 3), 22: (0, 1, 2), 34: (0, 1, 2)}
"""Corners around flat cells by type: triangle, pixel, quadrilateral, and those of second order."""
_FLAT |= dict.fromkeys((23, 28, 30), (0, 1, 2, 3))
_TETRAHEDRON = ((0, 1, 3), (1, 2, 3), (2, 0, 3), (0, 2, 1))
_VOXEL = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
_CUBE = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_WEDGE = ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0))
_PYRAMID = ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))
_SOLID: dict[int, tuple[tuple[int, ...], ...]] = {
    **{10: _TETRAHEDRON, 24: _TETRAHEDRON, 11: _VOXEL, 12: _CUBE, 25: _CUBE, 29: _CUBE, 33: _CUBE},
    **{13: _WEDGE, 26: _WEDGE, 31: _WEDGE, 32: _WEDGE, 14: _PYRAMID, 27: _PYRAMID},
}
"""Corners of the sides of solid cells by type; middle nodes of those of second order are left."""


def split_lists(numbers: Corners, count: int) -> tuple[Corners, Corners]:
    """Divide lists that begin with their lengths into the corners and the lengths.

    Raises
    ------
    MalformedFileError
        The lists are not `count`, or go beyond the end.
    """
    if count > len(numbers):
        raise MalformedFileError(f"{count} cells have {len(numbers)} numbers")
    length = int(numbers[0]) if len(numbers) else 0
    if count and length >= 0 and len(numbers) == count * (1 + length):
        table = numbers.reshape(count, 1 + length)
        if (table[:, 0] == length).all():
            return table[:, 1:].ravel(), table[:, 0].copy()
    starts, at = np.empty(count, np.int64), 0
    for number in range(count):
        if at >= len(numbers) or numbers[at] < 0:
            raise MalformedFileError(f"cell {number} has no length")
        starts[number] = at
        at += 1 + int(numbers[at])
    if at != len(numbers):
        raise MalformedFileError(f"{count} cells have {at} numbers; announced are {len(numbers)}")
    is_corner = np.ones(len(numbers), np.bool_)
    is_corner[starts] = False
    return numbers[is_corner], numbers[starts]


def split_offsets(corners: Corners, ends: Corners) -> tuple[Corners, Corners]:
    """Return the corners and the lengths of lists that end at these places.

    Raises
    ------
    MalformedFileError
        The places are not in order, or beyond the end.
    """
    sizes = np.diff(ends, prepend=0)
    if len(ends) and (sizes.min() < 0 or ends[-1] > len(corners)):
        raise MalformedFileError("the cells end at places that are not in order, or do not exist")
    return corners[: int(ends[-1]) if len(ends) else 0], sizes


def cut_strips(corners: Corners, sizes: Corners) -> Corners:
    """Cut strips of triangles into triangles (F, 3) of one orientation."""
    starts = np.cumsum(sizes) - sizes
    parts = [np.empty((0, 3), np.int64)]
    for size in np.unique(sizes[sizes > 2]):
        strips = corners[starts[sizes == size][:, None] + np.arange(size)]
        triangles = np.stack([strips[:, i : size - 2 + i] for i in range(3)], axis=2)
        triangles[:, 1::2] = triangles[:, 1::2, [1, 0, 2]]
        parts.append(triangles.reshape(-1, 3))
    return np.concatenate(parts)


def cut_cells(
    corners: Corners, sizes: Corners, types: Corners, points: NDArray[np.floating]
) -> Corners:
    """Cut the flat cells, and the sides of solid ones that no other has, into triangles (F, 3).

    Those of solid cells look outwards, whichever way round the file lists the corners.

    Raises
    ------
    CloudFileError
        A cell has another number of corners than its type, or is of an unknown type.
    """
    if len(types) != len(sizes):
        raise MalformedFileError(f"{len(sizes)} cells have {len(types)} types")
    parts = [np.empty((0, 3), np.int64)]
    check_faces(corners, len(points))
    sides: list[tuple[Corners, NDArray[np.float64]]] = []
    for kind in np.unique(types).tolist():
        chosen = types == kind
        mine, lengths = corners[np.repeat(chosen, sizes)], sizes[chosen]
        if kind in (_STRIP, _POLYGON):
            parts.append((cut_strips if kind == _STRIP else triangulate)(mine, lengths))
        elif kind in _FLAT:
            parts.append(_fan(_table(mine, lengths, kind)[:, _FLAT[kind]]))
        elif kind in _SOLID:
            table = _table(mine, lengths, kind)
            centres = points[table].mean(axis=1, dtype=np.float64)
            sides += [(table[:, side], centres) for side in _SOLID[kind]]
        elif kind not in _WITHOUT_AREA:
            raise UnsupportedFileError(f"cells of VTK's type {kind} are not read")
    return np.concatenate([*parts, *_outside(sides, points)])


def _table(corners: Corners, sizes: Corners, kind: int) -> Corners:
    """Return the corners of cells of one type as a table."""
    if (sizes != sizes[0]).any() or sizes[0] <= _largest(kind):
        raise MalformedFileError(f"cells of type {kind} have {np.unique(sizes)[:9]} corners")
    return corners.reshape(len(sizes), int(sizes[0]))


def _largest(kind: int) -> int:
    """Return the largest place of a corner in the cells of a type."""
    return max(max(side) for side in _SOLID.get(kind, (_FLAT.get(kind, (0,)),)))


def _fan(polygons: Corners) -> Corners:
    count, size = polygons.shape
    return triangulate(polygons.ravel(), np.full(count, size, np.int64))


def _outside(
    sides: list[tuple[Corners, NDArray[np.float64]]], points: NDArray[np.floating]
) -> list[Corners]:
    """Return the triangles of the sides that occur once, turned away from the cells' centres."""
    found = []
    for size in (3, 4):
        mine = [(side, centres) for side, centres in sides if side.shape[1] == size]
        if not mine:
            continue
        every = np.concatenate([side for side, _ in mine])
        _, first, counts = np.unique(
            np.sort(every, axis=1), axis=0, return_index=True, return_counts=True
        )
        rows = np.sort(first[counts == 1])
        centres = np.concatenate([centres for _, centres in mine])[rows]
        found.append(_fan(_turn_outwards(every[rows], centres, points)))
    return found


def _turn_outwards(
    polygons: Corners, centres: NDArray[np.float64], points: NDArray[np.floating]
) -> Corners:
    places = points[polygons].astype(np.float64)
    normals = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    is_inwards = np.einsum("ij,ij->i", normals, places[:, 0] - centres) < 0
    return np.where(is_inwards[:, None], polygons[:, ::-1], polygons)
