"""Vertices of OBJ files, in the order of the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from service.formats.colors import RGB
from service.formats.decoded_cloud import DecodedCloud, ReadLimits
from service.formats.errors import MalformedFileError
from service.formats.faces import LARGE_MESH_WARNING
from service.formats.mesh.obj_faces import read_faces, read_normals, warn_of_normals
from service.formats.mesh.text_faces import has_colors, read_obj_colors, warn_of_numbers
from service.formats.numerals import significant_line
from service.formats.text_block import TextBlock
from service.formats.text_cleaner import Dialect, TableCleaner
from service.formats.text_table import iter_columns, read_columns

_OBJ_KEYWORDS = {b"v", b"vn", b"vt", b"vp", b"o", b"g", b"s", b"f", b"l", b"mtllib", b"usemtl"}
_VERTICES = Dialect(keyword="v")


def sniff_obj(head: bytes) -> bool:
    """Whether the first line that is no comment is an OBJ statement."""
    if b"\0" in head:
        return False
    words = significant_line(head).split()
    if words[:1] in ([b"g"], [b"o"], [b"s"]):
        return True
    return len(words) > 1 and words[0] in _OBJ_KEYWORDS


def read_obj(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> DecodedCloud:
    """Read the lines "v x y z ..." of an OBJ file; `attributes` adds colours and normals.

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
    if not faces and not attributes:
        return cloud
    found = read_faces(path, len(points), limits, warns_of_others=attributes)
    warnings = cloud.warnings + (found.warnings if faces else ())
    cloud = replace(cloud, faces=found.triangles if faces else None, warnings=warnings)
    if not attributes:
        return cloud
    normals, lost = read_normals(path, len(points), found, limits)
    kept = read_obj_colors(path, len(points), limits) | normals
    lost += warn_of_numbers(path)
    return replace(cloud, attributes=kept, warnings=cloud.warnings + lost)


def read_obj_pieces(
    path: Path, limits: ReadLimits, *, attributes: bool = False, faces: bool = False
) -> Iterator[DecodedCloud]:
    """Read as `read_obj` does, in consecutive pieces; `faces` and normals are not kept."""
    columns = (1, 2, 3, 4, 5, 6) if attributes and has_colors(path) else (1, 2, 3)
    text = TextBlock(path, 0, path.stat().st_size, 1)
    cleaner = TableCleaner(_VERTICES, columns)
    for table in iter_columns(text, columns, limits, dialect=_VERTICES, cleaner=cleaner):
        kept = dict(zip(RGB, table.T[3:], strict=False))
        yield DecodedCloud(table[:, :3], "obj", attributes=kept)
    warnings = cleaner.warnings() + ((LARGE_MESH_WARNING,) if faces else ())
    warnings += warn_of_normals(path) + warn_of_numbers(path) if attributes else ()
    yield DecodedCloud(np.empty((0, 3)), "obj", warnings)
