"""What the columns of a cloud are called in the files that people send."""

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
    """Return the places of x, y and z among the names of the columns, None without them."""
    return _find(names, _XYZ)


def find_normals(names: Sequence[str]) -> tuple[int, ...] | None:
    """Return the places of the normal's components, None without them."""
    return _find(names, _NORMALS)


def _find(names: Sequence[str], triples: Sequence[tuple[str, ...]]) -> tuple[int, ...] | None:
    bare = [_bare(name) for name in names]
    for triple in triples:
        if all(bare.count(part) == 1 for part in triple):
            return tuple(bare.index(part) for part in triple)
    return None


def _bare(name: str) -> str:
    """Lower case, without quotes and without a unit in brackets."""
    return re.sub(r"\s*[\[(].*[\])]$", "", name.strip().strip("\"'").lower())
