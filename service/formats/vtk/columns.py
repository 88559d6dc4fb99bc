"""Arrays of VTK as normals and attributes of points."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from service.formats.colors import RGB

_NORMALS = {"normals", "normal", "normals_", "pointnormals", "point_normals"}
_COLORS = {"rgb", "rgba", "color", "colors", "colour", "colours", "scalar_colors"}
_MAX_WIDTH = 9
"""Components of an array that are kept, those of a tensor."""

NamedRows = tuple[str, NDArray[np.generic]]
"""Name and (N, C) values."""


def name_columns(
    arrays: Iterable[NamedRows],
) -> tuple[NDArray[np.floating] | None, dict[str, NDArray[np.generic]]]:
    """Return the normals (N, 3), if there are any, and the others as columns (N,).

    Three or four bytes are a colour, as VTK draws them; components of other arrays are called
    name:0, name:1, ..., as ParaView writes them.
    """
    normals: NDArray[np.floating] | None = None
    columns: dict[str, NDArray[np.generic]] = {}
    for name, values in arrays:
        width = values.shape[1]
        if width == 3 and name.lower() in _NORMALS and values.dtype.kind == "f" and normals is None:
            normals = values.astype(np.result_type(values.dtype, np.float32))
        elif 1 <= width <= _MAX_WIDTH:
            for part, column in zip(_names(name, values, columns), values.T, strict=True):
                columns.setdefault(part, column)
    return normals, columns


def _names(name: str, values: NDArray[np.generic], taken: Iterable[str]) -> list[str]:
    width = values.shape[1]
    is_color = width in (3, 4) and (values.dtype == np.uint8 or name.lower() in _COLORS)
    if is_color and not set(RGB) & set(taken):
        return [*RGB, "alpha"][:width]
    return [name] if width == 1 else [f"{name}:{i}" for i in range(width)]
