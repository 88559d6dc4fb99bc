"""Names for columns that a file does not name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_NORMALS = ("nx", "ny", "nz")
_COLORS = ("red", "green", "blue")
_UNIT_TOL = 0.01
"""Distance from length 1 up to which three columns are a normal; files round to two digits."""

_MAX_RETURNS = 7
"""Number of returns up to which two columns behind an intensity count them, as las2txt writes."""


def name_columns(
    table: NDArray[np.generic], numbers: Sequence[int], names: list[str] | None = None
) -> dict[str, NDArray[np.generic]]:
    """Name columns by their place; three unit vectors are normals, three whole bytes colours.

    Parameters
    ----------
    table
        (N, K) columns beside the coordinates.
    numbers
        Of the K columns in the file, from 1.
    names
        Of a file in pieces: receives the names by the first piece, which the others then have.
    """
    if names:
        return {name: _to_bytes(name, table[:, i]) for i, name in enumerate(names)}
    named = _find_names(table, numbers)
    if names is not None and len(table):
        names += named
    return named


def _to_bytes(name: str, column: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return colours of whole bytes as such; those of a later piece may be others."""
    if name not in _COLORS or column.dtype.kind not in "iuf":
        return column
    narrow = column.astype(np.float64).clip(0, 255).astype(np.uint8)
    return narrow if (narrow == column).all() else column


def _find_names(
    table: NDArray[np.generic], numbers: Sequence[int]
) -> dict[str, NDArray[np.generic]]:
    named: dict[str, NDArray[np.generic]] = {}
    column = 0
    while column < table.shape[1]:
        part = table[:, column : column + 3]
        names = _triple_names(part) if part.shape[1] == 3 else None
        if names is None or names[0] in named:
            named[f"column_{numbers[column]}"] = table[:, column]
            column += 1
            continue
        kind = np.uint8 if names == _COLORS else part.dtype
        named |= {name: part[:, i].astype(kind) for i, name in enumerate(names)}
        column += 3
    return named


def _triple_names(part: NDArray[np.generic]) -> tuple[str, str, str] | None:
    if len(part) == 0 or part.dtype.kind not in "iuf":
        return None
    values = part[np.isfinite(part.astype(np.float64)).all(axis=1)].astype(np.float64)
    if len(values) == 0:
        return None
    lengths = np.linalg.norm(values, axis=1)
    if (np.abs(lengths[lengths > 0] - 1) < _UNIT_TOL).all() and (lengths > 0).any():
        is_normal = len(np.unique(values)) > 2
        return _NORMALS if is_normal else None
    is_byte = (values == np.rint(values)) & (values >= 0) & (values <= 255)
    if values[:, 1:].min() >= 1 and values[:, 1:].max() <= _MAX_RETURNS:
        return None
    return _COLORS if is_byte.all() and values.max() > 1 and len(values) == len(part) else None
