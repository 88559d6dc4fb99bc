"""Nearest points of a fixed surface, tabulated on a lattice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.surface import Surface
from mpe_core.kernels.bounds import bounding_box
from mpe_core.kernels.distance_transform import nearest_point_index

CELL_SIZE = 0.03
"""Edge of a lattice cell in radii of the smaller cloud: twice the spacing of the thinned points."""

MARGIN = 0.2
"""Width of the lattice beyond the surface, in radii; farther points read its border."""

MAX_CELLS = 2_000_000
"""Bound on the cells, 8 MB; a larger scene gets larger cells."""


@dataclass(frozen=True, slots=True)
class NearestLattice:
    """For each cell of a lattice, the row of the surface's point that is nearest to it."""

    surface: Surface
    """Surface whose points are tabulated."""
    rows: NDArray[np.int32]
    """(nx, ny, nz) rows of `surface.points`."""
    origin: NDArray[np.float32]
    """(3,) lowest corner of the lattice."""
    cell: np.float32
    """Edge of a cell."""


def build_lattice(surface: Surface) -> NearestLattice:
    """Tabulate the nearest point of the surface on a lattice around it."""
    low, high = bounding_box(surface.points).astype(np.float64)
    origin = (low - MARGIN).astype(np.float32)
    size = high + MARGIN - origin
    cell = max(CELL_SIZE, float(np.cbrt(np.prod(size) / MAX_CELLS)))
    shape = np.ceil(size / cell).astype(np.int64) + 1
    rows: NDArray[np.int32] = nearest_point_index(surface.points, origin, np.float32(cell), shape)
    return NearestLattice(surface, rows, origin, np.float32(cell))
