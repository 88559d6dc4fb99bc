"""Names of the columns that hold coordinates and normals."""

from __future__ import annotations

import re
from collections.abc import Sequence

_XYZ = (
    ("x", "y", "z"),
    ("px", "py", "pz"),
    ("pos_x", "pos_y", "pos_z"),
    ("easting", "northing", "elevation"),
    ("easting", "northing", "height"),
    ("points:0", "points:1", "points:2"),  # ParaView
    ("points_0", "points_1", "points_2"),
)
_NORMALS = (
    ("nx", "ny", "nz"),
    ("normal_x", "normal_y", "normal_z"),
    ("normalx", "normaly", "normalz"),
    ("normals:0", "normals:1", "normals:2"),
)


def find_xyz(names: Sequence[str]) -> tuple[int, ...] | None:
    """Find the indices of the columns x, y and z; None unless each is there once."""
    return _find_triple(names, _XYZ)


def find_normals(names: Sequence[str]) -> tuple[int, ...] | None:
    """Find the indices of the components of the normal; None unless each is there once."""
    return _find_triple(names, _NORMALS)


def _find_triple(
    names: Sequence[str], triples: Sequence[tuple[str, ...]]
) -> tuple[int, ...] | None:
    bare = [_normalize(name) for name in names]
    for triple in triples:
        if all(bare.count(part) == 1 for part in triple):
            return tuple(bare.index(part) for part in triple)
    return None


def _normalize(name: str) -> str:
    """Convert to lower case, without quotes and without a unit in brackets."""
    return re.sub(r"\s*[\[(].*[\])]$", "", name.strip().strip("\"'").lower())
