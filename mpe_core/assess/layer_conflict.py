"""Layer conflict: a pose is wrong at which what one scan shows is missing in the other."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpe_core.clouds.ground import Ground
from mpe_core.geometry.rigid import apply
from mpe_core.search.levelled_search import (
    CELL_SIZE,
    LevelledCloud,
    OccupancyGrids,
    draw_grids,
)

Array = NDArray[np.float64]

MAX_GROUND_TILT_DEG, MAX_GROUND_OFFSET = 12.0, 0.1
"""Tilt and offset up to which the grounds of both clouds count as one."""

MIN_COMPARED_CELLS = 20
"""Cells that have to be comparable; fewer tell nothing."""


class LayerConflict:
    """Both clouds of a pair as seen from above, to be compared at any pose."""

    def __init__(
        self,
        source: NDArray[np.float32],
        target: NDArray[np.float32],
        source_ground: Ground,
        target_ground: Ground,
    ) -> None:
        """Look at source (N, 3) and target (M, 3) from above their grounds."""
        self._points = source
        self._ground = source_ground
        self._target_ground = target_ground
        self._source = LevelledCloud.from_points(source, source_ground)
        self._target = LevelledCloud.from_points(target, target_ground)
        self._origin = self._target.xy.min(axis=0) - CELL_SIZE
        self._cells = int(np.ceil(np.ptp(self._target.xy, axis=0).max() / CELL_SIZE)) + 3
        self._fixed = draw_grids(self._target.xy, self._target.layer, self._origin, self._cells)

    @cached_property
    def _upside_down(self) -> LevelledCloud:
        return LevelledCloud.from_points(self._points, self._ground.flipped())

    def share(self, T: Array) -> float | None:
        """Share of the occupied cells of one cloud that the other one shows as clear.

        The larger of both directions, in [0, 1]. None where the grounds are not one at the pose, or
        too little can be compared.

        Parameters
        ----------
        T
            (4, 4) T_target_source.
        """
        up = T[:3, :3] @ self._ground.up
        cosine = float(up @ self._target_ground.up)
        if abs(cosine) < np.cos(np.radians(MAX_GROUND_TILT_DEG)):
            return None
        foot = apply(T, (self._ground.height * self._ground.up)[None])[0]
        if abs(foot @ self._target_ground.up - self._target_ground.height) > MAX_GROUND_OFFSET:
            return None
        levelled = self._source if cosine > 0 else self._upside_down
        xy = np.einsum("ij,nj->ni", self._target.R, apply(T, self._points))[:, :2]
        moving = draw_grids(xy, levelled.layer, self._origin, self._cells)
        shares = [_conflict(moving, self._fixed), _conflict(self._fixed, moving)]
        known = [share for share in shares if share is not None]
        return max(known) if known else None


def _conflict(one: OccupancyGrids, other: OccupancyGrids) -> float | None:
    conflicts = int((one.occupied & other.clear).sum())
    compared = conflicts + int((one.occupied & other.grown).sum())
    return conflicts / compared if compared >= MIN_COMPARED_CELLS else None
