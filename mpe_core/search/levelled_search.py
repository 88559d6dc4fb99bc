"""Search over four degrees of freedom for levelled scenes: a turn about the vertical and a shift.

Two scans that show one ground are seen from above, as occupancy grids (Moravec and Elfes 1985) at a
few heights over the ground. A cell is occupied if points lie in it, and clear if the scan shows a
surface there but nothing at that height. For each turn it is counted for all shifts how many
occupied cells meet occupied ones or their neighbours, and how many meet clear ones, first in coarse
cells, then in fine ones around the best turns and shifts:

    score(turn, shift) = matches - conflict_weight * conflicts

Unlike the overlap of points, this counts against a pose what should be seen at it and is not: large
flat surfaces that slide on themselves say nothing, and a small overlap that fits beats a large one
that does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.rigid import pose
from mpe_core.kernels.layer_shifts import find_shifts, list_cells
from mpe_core.kernels.shift_windows import EDGE, best_shifts, window_masks
from mpe_core.progress import FractionCallback
from mpe_core.search.levelled_cloud import CELL_SIZE, LevelledCloud
from mpe_core.search.levelled_effort import LevelledEffort
from mpe_core.search.pose_search import Candidates

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

MAX_GRID_CELLS = 300
"""Cells along one side of a grid; wider scenes get larger cells, so that time stays bounded."""

MAX_SHIFT_SHARE = 0.75
"""Largest distance of the centres over the sum of the radii; beyond it, clouds share their rims."""

CONFLICT_WEIGHTS = (1.0, 2.0)
"""Weights of a conflict over a match. The first finds airborne strips and streets, the second
halls with low overlap (docs/tuning.md)."""

COARSE_CELLS = 2
"""Cells of the first pass over those of the others (docs/tuning.md)."""

SHIFTS_PER_TURN = 20
"""Coarse peaks that are taken for each turn and each weight (docs/tuning.md)."""

PEAK_RADIUS, FINE_PEAK_RADIUS = 2, 3
"""Cells around a peak in which no other is taken, coarse and fine ones."""

WINDOW_START = (EDGE - COARSE_CELLS) // 2
"""Fine cells of a window before those of the coarse peak in its middle."""


def find_levelled_poses(
    source: LevelledCloud,
    target: LevelledCloud,
    effort: LevelledEffort,
    report: FractionCallback,
) -> Candidates:
    """Find the poses with the highest scores, for each of CONFLICT_WEIGHTS.

    Three passes: coarse cells choose turns and shifts, some of the fine cells choose among these,
    and all of them tell the scores.

    Parameters
    ----------
    source, target
        Clouds seen from above.
    effort
        Turns, windows and cells that are looked at, and poses of each weight.
    report
        Takes the fraction that is done.

    Returns
    -------
    Candidates
        Poses that lay the grounds on each other, the best first, with their scores over the best
        one of the same weight.
    """
    reach = MAX_SHIFT_SHARE * (source.radius + target.radius)
    size = max(CELL_SIZE, 2 * reach / MAX_GRID_CELLS)
    every_turn = np.radians(np.arange(0.0, 360.0, effort.turn_step_deg))
    coarse = _Counter(source, target, COARSE_CELLS * size, reach)
    scores, shifts = coarse.find_all(every_turn, reach, effort.coarse_counted)
    report(0.5)
    fine = _Counter(source, target, size, reach)
    best_turns = _best(scores[:, :, 0], effort.turns_kept)
    fine_turns = np.radians(effort.fine_turns_deg)
    windows = _Windows.around_peaks(every_turn[best_turns], shifts[best_turns], fine_turns)
    scores, _ = fine.find_in(windows, effort.few_counted)
    report(0.7)
    windows = windows.select(_best(scores, effort.windows_kept))
    scores, shifts = fine.find_in(windows, effort.max_counted)
    turns = windows.turn_of_each
    poses, relative = [], []
    for kind in range(len(CONFLICT_WEIGHTS)):
        found = scores[:, kind]
        for window in _distinct(found, turns, shifts[:, kind], effort.candidates):
            if found[window] > 0:
                shift = size * shifts[window, kind]
                poses.append(_pose(source, target, turns[window], shift))
                relative.append(found[window] / found.max())
    order = np.argsort(-np.array(relative), kind="stable")
    return Candidates(
        np.array(poses).reshape(-1, 4, 4)[order], np.array(relative, np.float32)[order]
    )


def _best(scores: Array, count: int) -> Rows:
    """(K,) whether each of the scores (K, weights) is among the best of a weight."""
    is_best = np.zeros(len(scores), np.bool_)
    is_best[np.argsort(-scores, axis=0, kind="stable")[:count]] = True
    return is_best


@dataclass(frozen=True, slots=True)
class _Windows:
    """Windows of shifts of the source, some for each turn."""

    turns: Array
    """(T,) turns about the vertical, in radians."""
    starts: NDArray[np.int64]
    """(T + 1,) bounds of the windows of each turn."""
    corners: NDArray[np.int64]
    """(W, 2) first shift of each window, in cells."""

    @classmethod
    def around_peaks(cls, turns: Array, shifts: NDArray[np.int64], steps: Array) -> _Windows:
        """Windows of fine cells around coarse shifts (T, weights, peaks, 2) at the turns (T,).

        Each is looked at under the turns `steps` (K,) from there.
        """
        # both weights often have the same peaks
        peaks = [np.unique(each.reshape(-1, 2), axis=0) for each in shifts]
        corners = [COARSE_CELLS * each - WINDOW_START for each in peaks for _ in steps]
        return cls(
            np.add.outer(turns, steps).ravel(),
            np.cumsum([0, *(len(each) for each in corners)]),
            np.concatenate(corners),
        )

    @property
    def turn_of_each(self) -> Array:
        """(W,) turn of each window."""
        return np.repeat(self.turns, np.diff(self.starts))

    def select(self, chosen: Rows) -> _Windows:
        """Take the chosen (W,) of the windows."""
        before = np.cumsum([0, *chosen])
        return _Windows(self.turns, before[self.starts], self.corners[chosen])


class _Counter:
    """Counts matches and conflicts of the source over the target, in cells of one size."""

    def __init__(
        self, source: LevelledCloud, target: LevelledCloud, size: float, reach: float
    ) -> None:
        """Draw the target in cells of edge `size`; what shows clear cells counts up to `reach`."""
        self._size, self._source_cells = size, _cells_around(source, size, reach)
        cells = _cells_around(target, size, reach)
        grids = target.draw(np.eye(2), np.full(2, cells // 2 * size) - target.centre, cells, size)
        self._grown, self._clear = grids.grown, grids.clear
        self._occupied = list_cells(grids.occupied)
        standing, showing = source.standing, source.showing
        self._source = (
            standing[0] - source.centre,
            standing[1],
            showing[0] - source.centre,
            showing[1],
        )

    def find_all(
        self, turns: Array, reach: float, max_counted: int
    ) -> tuple[Array, NDArray[np.int64]]:
        """Find the best of the shifts up to `reach` at each of the turns, see `find_shifts`."""
        scores, shifts = find_shifts(
            turns,
            int(np.ceil(reach / self._size)),
            self._source,
            self._source_cells,
            self._size,
            (self._grown, self._clear, self._occupied),
            max_counted,
            np.array(CONFLICT_WEIGHTS),
            SHIFTS_PER_TURN,
            PEAK_RADIUS,
        )
        return scores, shifts

    def find_in(self, windows: _Windows, max_counted: int) -> tuple[Array, NDArray[np.int64]]:
        """Find the best shift in each of the windows, see `best_shifts`."""
        scores, shifts = best_shifts(
            windows.turns,
            windows.starts,
            np.ascontiguousarray(windows.corners),
            self._source,
            self._source_cells,
            self._size,
            (*self._masks, self._occupied),
            self._grown.shape[1],
            max_counted,
            np.array(CONFLICT_WEIGHTS),
        )
        return scores, shifts

    @cached_property
    def _masks(self) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        return window_masks(self._grown), window_masks(self._clear)


def _cells_around(cloud: LevelledCloud, size: float, reach: float) -> int:
    """Cells along a side of a grid that holds the cloud, however it is turned about its centre."""
    shown = float(np.sqrt(np.square(cloud.showing[0] - cloud.centre).sum(axis=1).max(initial=0)))
    return 2 * (int(np.ceil(max(cloud.radius, min(shown, reach)) / size)) + 1)


def _distinct(scores: Array, turns: Array, shifts: NDArray[np.int64], count: int) -> list[int]:
    """Up to `count` windows, best first, whose shift is apart from better ones at the same turn."""
    kept: list[int] = []
    for window in np.argsort(-scores, kind="stable"):
        apart = np.abs(shifts[kept] - shifts[window]).max(axis=1, initial=0)
        if (apart[turns[kept] == turns[window]] > FINE_PEAK_RADIUS).all():
            kept.append(int(window))
        if len(kept) == count:
            break
    return kept


def _pose(source: LevelledCloud, target: LevelledCloud, turn: float, shift: Array) -> Array:
    """(4, 4) pose that turns the source about its centre and shifts it over the target's."""
    R = np.eye(3)
    R[:2, :2] = _turn(turn)
    t = np.zeros(3)
    t[:2] = target.centre + shift - R[:2, :2] @ source.centre
    t[2] = target.ground.height - source.ground.height
    return pose(target.R.T @ R @ source.R, target.R.T @ t)


def _turn(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])
