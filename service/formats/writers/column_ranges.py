"""Ranges of the columns of a cloud that comes in pieces, as a cloud of few rows.

Writers choose types, scales and names by the smallest and largest number of a column, and by
whether all are whole and finite. Four rows that hold these for every column make each piece, to
which they are appended, be written as the whole cloud would be.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud

MODEL_ROWS = 4
"""The least, the largest, one that is not whole, and one that is not finite; else the least."""
Column = NDArray[np.generic]


@dataclass(slots=True)
class ColumnRanges:
    """Gathers the ranges piece by piece."""

    count: int = 0
    """Points so far."""
    missing: int = 0
    """Points so far without finite coordinates."""
    warnings: dict[str, None] = field(default_factory=dict)
    """What the pieces said, each text once."""
    _first: DecodedCloud | None = None
    _last: DecodedCloud | None = None
    _points: NDArray[np.floating] | None = None
    _columns: dict[str, Column] = field(default_factory=dict)

    def add(self, piece: DecodedCloud) -> None:
        """Take the next piece; attributes that it lacks are not kept."""
        self.warnings |= dict.fromkeys(piece.warnings)
        self._last = piece
        if len(piece.points) == 0:
            return
        if self._first is None:
            self._first = replace(piece, points=piece.points[:0], attributes={}, warnings=())
            self._columns = {name: column[:0] for name, column in piece.attributes.items()}
        common = [name for name in self._columns if name in piece.attributes]
        if len(common) < len(self._columns):
            lost = ", ".join(repr(name[:40]) for name in self._columns if name not in common)
            self.warnings[f"not kept, because parts of the file do not have them: {lost}"] = None
        self._columns = {
            name: _bounds(np.concatenate([self._columns[name], piece.attributes[name]]))
            for name in common
        }
        finite = piece.points[np.isfinite(piece.points).all(axis=1)]
        self.count += len(piece.points)
        self.missing += len(piece.points) - len(finite)
        held = finite if self._points is None else np.concatenate([self._points, finite])
        if len(held):
            low, high = held.min(axis=0), held.max(axis=0)
            self._points = np.stack([low, high, low, low])

    def model(self) -> DecodedCloud:
        """Return MODEL_ROWS rows with the ranges of all columns."""
        first = self._first or self._last
        if first is None:
            raise ValueError("no piece was added")
        points = np.zeros((MODEL_ROWS, 3)) if self._points is None else self._points
        return replace(first, points=points, attributes=dict(self._columns), normals=None)

    def extend(self, piece: DecodedCloud) -> DecodedCloud:
        """Return the piece with the model's columns and types, and its rows at the end."""
        model = self.model()
        attributes = {
            name: np.concatenate([piece.attributes[name].astype(column.dtype), column])
            for name, column in model.attributes.items()
        }
        points = np.concatenate([piece.points.astype(model.points.dtype), model.points])
        return replace(model, points=points, attributes=attributes)


def _bounds(column: Column) -> Column:
    """Return MODEL_ROWS numbers that bound the column."""
    if column.dtype.kind not in "iuf":
        return column[:MODEL_ROWS] if len(column) >= MODEL_ROWS else np.resize(column, MODEL_ROWS)
    odd = np.empty(0, column.dtype)
    finite = column
    if column.dtype.kind == "f":
        is_finite = np.isfinite(column)
        finite, odd = column[is_finite], column[~is_finite][:1]
    if len(finite) == 0:
        return np.resize(odd, MODEL_ROWS)
    low, high = finite.min(), finite.max()
    if column.dtype.kind == "f":
        other = finite[finite != np.rint(finite)][:1]
    else:
        other = finite[finite.astype(np.int64) & 255 != 0][:1]
    return np.array([low, high, *(other if len(other) else [low]), *(odd if len(odd) else [low])])
