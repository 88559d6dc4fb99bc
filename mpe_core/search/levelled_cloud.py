"""A cloud seen from above: what stands on its ground, and what its scanners saw through there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from mpe_core.clouds.ground import Ground
from mpe_core.geometry.cell_list import CellList, Points
from mpe_core.geometry.rigid import rotation_between
from mpe_core.geometry.sampling import take_every
from mpe_core.geometry.viewpoints import nearest_viewpoint
from mpe_core.kernels.layer_shifts import EVERY_LAYER, draw_layers
from mpe_core.kernels.ray_cells import count_crossings

Array = NDArray[np.float64]
Grid = NDArray[np.uint8]
Layers = NDArray[np.int64]
Rows = NDArray[np.bool_]

CELL_SIZE = 0.02
"""Edge of a grid cell in radii of the smaller cloud: about the spacing of the thinned points."""

LAYER_EDGES = np.array([0.012, 0.03, 0.05, 0.12, 0.3, 1.0])
"""Heights over the ground between the layers, in radii of the smaller cloud; below the first lies
the ground itself (docs/tuning.md)."""

LAYERS = len(LAYER_EDGES) - 1

GROUND_CELL_SIZE = 0.08
"""Edge of the cells in which the lowest point is the local ground: slopes are no obstacles."""

NORMAL_RADIUS, MAX_UPRIGHT_COSINE = 0.04, 0.7
"""Radius of the neighbourhoods that tell upright surfaces from level ones, in radii of the smaller
cloud, and the cosine between normal and vertical up to which a surface is upright."""

MIN_ROOFED_SHARE = 0.45
"""Share of the level surfaces over seen ground from which on a scene has a ceiling. Ceilings match
ceilings wherever they slide (docs/tuning.md)."""

MAX_RAYS, RAY_SHARE, MIN_RAY_SAMPLES = 8000, 0.92, 2
"""Rays from the viewpoints that are followed, the share of each that is free, and the samples of
rays that clear a cell."""

MAX_RAY_STEPS = 400
"""Steps of CELL_SIZE along one ray: stray points at any distance cost no more."""


class LocalGround:
    """Lowest height of levelled points (N, 3) in the coarse cells around a place."""

    def __init__(self, levelled: Array) -> None:
        index = np.floor(levelled[:, :2] / GROUND_CELL_SIZE).astype(np.int64)
        self._corner = index.min(axis=0)
        index -= self._corner
        lowest = np.full(index.max(axis=0) + 1, np.inf)
        np.minimum.at(lowest, (index[:, 0], index[:, 1]), levelled[:, 2])
        seen = np.isfinite(lowest)
        eroded = minimum_filter(lowest, 3)
        self._lowest = maximum_filter(np.where(seen, eroded, -np.inf), 3)
        self._lowest[np.isneginf(self._lowest)] = np.inf

    @property
    def table(self) -> tuple[Array, NDArray[np.int64], float]:
        """Heights (w, h), infinite where none is near; index (2,) of the first cell; edge."""
        return self._lowest, self._corner, GROUND_CELL_SIZE

    def at(self, xy: Array) -> Array:
        """(N,) heights at the places (N, 2); infinite where no point is near."""
        index = np.floor(xy / GROUND_CELL_SIZE).astype(np.int64) - self._corner
        inside = ((index >= 0) & (index < self._lowest.shape)).all(axis=1)
        heights = np.full(len(xy), np.inf)
        heights[inside] = self._lowest[index[inside, 0], index[inside, 1]]
        return heights


@dataclass(frozen=True)
class LevelledCloud:
    """Points seen from above, with their heights over the ground."""

    ground: Ground
    """Plane that the cloud is seen from above of."""
    R: Array
    """(3, 3) rotation that turns the vertical to z."""
    levelled: Array
    """(N, 3) points, turned by R."""
    heights: LocalGround
    """Heights of the ground."""
    layer: Layers
    """(N,) layer of each point; -1 on the ground, LAYERS above all layers."""
    free_xy: Array | None = None
    """(M, 2) cells that rays of the scanners crossed; None if their places are not known."""
    free_layer: Layers | None = None
    """(M,) layer of each of these cells."""

    @classmethod
    def from_points(cls, points: Points, ground: Ground) -> LevelledCloud:
        """Look at the points (N, 3), in radii of the smaller cloud, from above their ground."""
        R = rotation_between(ground.up, np.array([0.0, 0.0, 1.0]))
        levelled = np.einsum("ij,nj->ni", R, points.astype(np.float64))
        heights = LocalGround(levelled)
        layer = np.searchsorted(LAYER_EDGES, levelled[:, 2] - heights.at(levelled[:, :2])) - 1
        return cls(ground, R, levelled, heights, layer)

    def has_ceiling(self, is_level: Rows) -> bool:
        """Tell whether the level (N,) of the points hang over the ground that is seen."""
        over = is_level & (self.layer >= 0)
        if not over.any():
            return False
        cell = np.floor(self.xy / CELL_SIZE).astype(np.int64)
        cell -= cell.min(axis=0)
        number = cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1]
        return float(np.isin(number[over], number[self.layer < 0]).mean()) >= MIN_ROOFED_SHARE

    def over(self, is_ground: Rows) -> LevelledCloud:
        """Count some (N,) of the points as ground, at whatever height they are."""
        return replace(self, layer=np.where(is_ground, -1, self.layer))

    def seen_from(self, viewpoints: Array) -> LevelledCloud:
        """Follow the rays from the places (k, 3) of the scanners to the points."""
        places = np.array([self.R @ place for place in viewpoints])
        free_xy, free_layer = _follow_rays(self.levelled, places, self.heights)
        return replace(self, free_xy=free_xy, free_layer=free_layer)

    @cached_property
    def xy(self) -> Array:
        """(N, 2) positions."""
        return self.levelled[:, :2].copy()

    @cached_property
    def centre(self) -> Array:
        """(2,) centre of the box around the points."""
        middle: Array = (self.xy.max(axis=0) + self.xy.min(axis=0)) / 2
        return middle

    @cached_property
    def radius(self) -> float:
        """Largest distance of a point from the centre."""
        return float(np.sqrt(np.square(self.xy - self.centre).sum(axis=1).max()))

    @cached_property
    def standing(self) -> tuple[Array, Layers]:
        """Positions (K, 2) and layers (K,) of the points that lie in a layer."""
        standing = (self.layer >= 0) & (self.layer < LAYERS)
        return self.xy[standing], self.layer[standing]

    @property
    def showing(self) -> tuple[Array, Layers]:
        """Positions (M, 2) and layers (M,) of what shows that cells without points are clear."""
        if self.free_xy is None or self.free_layer is None:
            return self.xy, np.full(len(self.xy), EVERY_LAYER)
        return self.free_xy, self.free_layer

    def count_occupied(self) -> int:
        """Count the cells of all layers that hold points."""
        xy, layer = self.standing
        cells = np.floor(xy / CELL_SIZE).astype(np.int64)
        cells -= cells.min(axis=0, initial=0)
        width, height = cells.max(axis=0, initial=0) + 1
        return len(np.unique((layer * width + cells[:, 0]) * height + cells[:, 1]))

    def draw(self, A: Array, b: Array, cells: int, cell_size: float = CELL_SIZE) -> OccupancyGrids:
        """Draw the cloud moved by x -> A x + b into grids whose corner is the origin.

        Parameters
        ----------
        A, b
            (2, 2) turn and (2,) shift.
        cells
            Cells along one side of a grid.
        cell_size
            Edge of a cell.
        """
        drawn = draw_layers(
            (*self.standing, *self.showing), A / cell_size, b / cell_size, LAYERS, cells
        )
        return OccupancyGrids(*drawn)


@dataclass(frozen=True, slots=True)
class OccupancyGrids:
    """Grids (LAYERS, n, n) of a cloud seen from above; marked cells are 1."""

    occupied: Grid
    """Cells with points."""
    grown: Grid
    """Occupied cells and their eight neighbours."""
    clear: Grid
    """Cells that the scanners saw through, or, where their places are not known, that show a
    surface; without those with points at this layer in them or beside them."""


def is_level(points: Points, ground: Ground) -> Rows:
    """(N,) whether the surface around each of the points (N, 3) is level rather than upright."""
    normals = CellList(points, NORMAL_RADIUS).planes(points).normals.astype(np.float64)
    level: Rows = np.abs(np.einsum("ni,i->n", normals, ground.up)) > MAX_UPRIGHT_COSINE
    return level


def _follow_rays(levelled: Array, viewpoints: Array, heights: LocalGround) -> tuple[Array, Layers]:
    """Centres (M, 2) and layers (M,) of the cells that the rays to the points (N, 3) cross.

    Each ray starts at the nearest of the viewpoints (k, 3).
    """
    seen = take_every(levelled, MAX_RAYS)
    starts = viewpoints[nearest_viewpoint(seen, viewpoints)]
    offset = seen - starts
    ranges = np.sqrt(np.einsum("ni,ni->n", offset, offset))
    steps = np.clip(RAY_SHARE * ranges / CELL_SIZE, 0, MAX_RAY_STEPS).astype(np.int64)
    ends = starts + (steps * CELL_SIZE / np.maximum(ranges, CELL_SIZE))[:, None] * offset
    reached = np.floor(np.vstack([starts, ends])[:, :2] / CELL_SIZE).astype(np.int64)
    low, high = reached.min(axis=0), reached.max(axis=0)
    counts = np.zeros((LAYERS, *(high - low + 1)), np.int32)
    count_crossings(
        starts, offset, ranges, steps, CELL_SIZE, heights.table, LAYER_EDGES, low, counts
    )
    layer, *place = np.nonzero(counts >= MIN_RAY_SAMPLES)
    return (np.stack(place, axis=1) + low + 0.5) * CELL_SIZE, np.ascontiguousarray(layer)
