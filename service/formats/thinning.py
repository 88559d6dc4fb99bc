"""Thinning of a cloud that comes in pieces, to a number of points that the memory holds."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from service.formats.decoded_cloud import DecodedCloud
from service.formats.errors import MalformedFileError, missing_attribute
from service.formats.las_metadata import LasRecord

_MIN_EDGE_SHARE = 2.0**-40
"""Finest cell, as a share of the cloud's extent, that is tried."""
_KEPT_SHARE = 0.5
"""Share of the points that a coarser grid may keep, so that it lasts for some time."""
_MAX_EXPONENT = 1020
"""Power of two of the coarsest cell; float64 ends at 1024."""
_MIN_POINTS = 16
"""Points that are kept at least: cells around the origin divide each cloud into eight."""
_MIN_FREE_SHARE = 0.25
"""Share of the table of cells that stays empty, so that look-ups stay short."""


def thin_pieces(
    pieces: Iterable[DecodedCloud], max_points: int, weights: str | None = None
) -> DecodedCloud:
    """Keep the first point of the file in each cubic cell; the cells double until all fit.

    The result depends on the file and on `max_points`, not on how the file is divided into pieces.

    Parameters
    ----------
    pieces
        Consecutive parts of the cloud; those after the first have its type of coordinates.
    max_points
        Points that may be kept.
    weights
        Name of the attribute to keep with the points.

    Returns
    -------
    DecodedCloud
        With `rows`, and a warning that tells what was kept; without other attributes than the
        coordinate system.

    Raises
    ------
    MissingAttributeError
        A piece has no attribute `weights`.
    """
    thinning: _Thinning | None = None
    name, total = "", 0
    warnings: list[str] = []
    crs: tuple[LasRecord, ...] = ()
    viewpoints: tuple[tuple[float, ...], ...] = ()
    for piece in pieces:
        warnings += piece.warnings
        viewpoints = piece.viewpoints or viewpoints
        crs = piece.crs or crs
        if len(piece.points) == 0:
            continue
        if thinning is None:
            name = piece.format
            thinning = _Thinning(max(_MIN_POINTS, max_points), piece.points.dtype)
        if weights is not None and weights not in piece.attributes:
            raise missing_attribute(weights, piece.attributes)
        column = None if weights is None else piece.attributes[weights]
        thinning.add(piece.points, total, column)
        total += len(piece.points)
    if thinning is None:
        return DecodedCloud(np.empty((0, 3)), name, tuple(warnings), rows=np.empty(0, np.int64))
    warnings.append(
        f"of {total} points {thinning.count} are used, the first in each cube of edge "
        f"{thinning.edge:.3g}: the memory allowed holds {max_points}"
    )
    cloud = thinning.to_cloud(name, tuple(dict.fromkeys(warnings)), weights)
    return replace(cloud, crs=crs, viewpoints=viewpoints)


@dataclass(slots=True)
class _Thinning:
    """The points that are kept so far, and the cells that they stand for."""

    max_points: int
    dtype: np.dtype[np.floating]
    """Type of the coordinates."""
    count: int = 0
    """Points kept."""
    edge: float = 0.0
    """Edge of the cells; 0 while all points are kept."""
    _points: NDArray[np.floating] = field(init=False)
    _rows: NDArray[np.int64] = field(init=False)
    _weights: NDArray[np.float64] = field(init=False)
    _table: NDArray[np.uint64] = field(init=False)

    def __post_init__(self) -> None:
        self._points = np.empty((self.max_points, 3), self.dtype)
        self._rows = np.empty(self.max_points, np.int64)
        self._weights = np.empty(0)
        slots = 1 << math.ceil(math.log2(self.max_points / (1 - _MIN_FREE_SHARE) + 1))
        self._table = np.zeros(slots, np.uint64)

    def add(
        self, points: NDArray[np.floating], first_row: int, weights: NDArray[np.generic] | None
    ) -> None:
        """Add a piece whose first point is that of row `first_row` of the file."""
        from mpe_core.kernels.cell_filter import mark_first  # loads the kernels

        piece = np.ascontiguousarray(points, np.float64)
        is_first = np.empty(len(piece), np.bool_)
        row = 0
        while row < len(piece):
            room = self.max_points - self.count
            if self.edge == 0:
                end = min(len(piece), row + room)
                is_first[row:end] = np.isfinite(piece[row:end]).all(axis=1)
            else:
                end, _ = mark_first(piece, row, self.edge, self._table, room, is_first)
            kept = row + np.flatnonzero(is_first[row:end])
            self._append(points[kept], first_row + kept, None if weights is None else weights[kept])
            row = end
            if row < len(piece) and self.count == self.max_points:
                self._coarsen()

    def to_cloud(self, name: str, warnings: tuple[str, ...], weights: str | None) -> DecodedCloud:
        """Return what is kept."""
        n = self.count
        attributes: dict[str, NDArray[np.generic]] = {}
        if weights is not None:
            attributes[weights] = self._weights[:n].copy()
        points, rows = self._points[:n].copy(), self._rows[:n].copy()
        return DecodedCloud(points, name, warnings, attributes=attributes, rows=rows)

    def _append(
        self,
        points: NDArray[np.floating],
        rows: NDArray[np.int64],
        weights: NDArray[np.generic] | None,
    ) -> None:
        places = slice(self.count, self.count + len(rows))
        self._points[places], self._rows[places] = points, rows
        if weights is not None:
            if len(self._weights) == 0:
                self._weights = np.empty(self.max_points)
            self._weights[places] = weights
        self.count += len(rows)

    def _coarsen(self) -> None:
        """Take the smallest edge, a power of two, at which few enough points are left."""
        if self.edge:
            least = round(math.log2(self.edge)) + 1
        else:
            extent = float(np.ptp(self._points.astype(np.float64) / 2, axis=0).max()) or 1.0
            least = math.floor(math.log2(extent * _MIN_EDGE_SHARE))
        least = min(least, _MAX_EXPONENT)
        most = min(least - math.floor(math.log2(_MIN_EDGE_SHARE)) + 2, _MAX_EXPONENT)
        while least < most:
            middle = (least + most) // 2
            if self._mark(2.0**middle).sum() <= _KEPT_SHARE * self.max_points:
                most = middle
            else:
                least = middle + 1
        self.edge = 2.0**least
        kept = np.flatnonzero(self._mark(self.edge))
        if len(kept) == self.max_points:
            raise MalformedFileError(
                f"the coordinates reach {np.abs(self._points).max():.3g}; expected a scene of "
                "one scale"
            )
        self.count = len(kept)
        for held in (self._points, self._rows, self._weights):
            if len(held):
                held[: len(kept)] = held[kept]

    def _mark(self, edge: float) -> NDArray[np.bool_]:
        """Fill the table with the cells of this edge; return which points are first in theirs."""
        from mpe_core.kernels.cell_filter import EMPTY, mark_first

        self._table[:] = EMPTY
        is_first = np.zeros(self.count, np.bool_)
        points = np.ascontiguousarray(self._points[: self.count], np.float64)
        mark_first(points, 0, edge, self._table, self.count, is_first)
        return is_first
