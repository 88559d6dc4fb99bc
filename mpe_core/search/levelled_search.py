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

import numpy as np
from numpy.typing import NDArray

from mpe_core.geometry.rigid import pose
from mpe_core.kernels.layer_shifts import find_shifts, list_cells
from mpe_core.progress import FractionCallback
from mpe_core.search.levelled_cloud import CELL_SIZE, LevelledCloud
from mpe_core.search.pose_search import Candidates

Array = NDArray[np.float64]

MAX_GRID_CELLS = 300
"""Cells along one side of a grid; wider scenes get larger cells, so that time stays bounded."""

MAX_SHIFT_SHARE = 0.75
"""Largest distance of the centres over the sum of the radii; beyond it, clouds share their rims."""

TURN_STEP_DEG = 3.0
"""Step of the turns about the vertical: half a cell at 0.4 radii."""

CONFLICT_WEIGHTS = (1.0, 2.0)
"""Weights of a conflict over a match. The first finds airborne strips and streets, the second
halls with low overlap (docs/tuning.md)."""

COARSE_CELLS, TURNS_KEPT = 2, 24
"""Cells of a first pass over those of the second one, and turns of each weight that it leaves for
that (docs/tuning.md)."""

SHIFTS_PER_TURN = 20
"""Coarse peaks that are taken for each turn and each weight (docs/tuning.md)."""

PEAK_RADIUS, FINE_PEAK_RADIUS = 2, 3
"""Cells around a peak in which no other is taken, coarse and fine ones."""

WINDOW = 3
"""Fine cells to each side of a coarse peak among which the best one is looked for: one and a half
coarse cells."""


def find_levelled_poses(
    source: LevelledCloud, target: LevelledCloud, count: int, report: FractionCallback
) -> Candidates:
    """Find the poses with the highest scores, for each of CONFLICT_WEIGHTS.

    Parameters
    ----------
    source, target
        Clouds seen from above.
    count
        Poses of each weight.
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
    turns = np.radians(np.arange(0.0, 360.0, TURN_STEP_DEG))
    coarse = _Counter(source, target, COARSE_CELLS * size, reach)
    coarse_scores, coarse_shifts = coarse.find(
        turns,
        np.arange(len(turns) + 1),
        np.zeros((len(turns), 2), np.int64),
        int(np.ceil(reach / coarse.size)),
        SHIFTS_PER_TURN,
    )
    report(0.5)
    chosen = _best_turns(coarse_scores)
    # both weights often have the same peaks
    centres = [np.unique(coarse_shifts[turn].reshape(-1, 2), axis=0) for turn in chosen]
    starts = np.concatenate([[0], np.cumsum([len(each) for each in centres])])
    turn_of_window = np.repeat(turns[chosen], np.diff(starts))
    scores, shifts = _Counter(source, target, size, reach).find(
        turns[chosen], starts, COARSE_CELLS * np.concatenate(centres), WINDOW, 1
    )
    poses, relative = [], []
    for kind in range(len(CONFLICT_WEIGHTS)):
        found = scores[:, kind, 0]
        for window in _distinct(found, turn_of_window, shifts[:, kind, 0], count):
            if found[window] > 0:
                shift = size * shifts[window, kind, 0]
                poses.append(_pose(source, target, turn_of_window[window], shift))
                relative.append(found[window] / found.max())
    order = np.argsort(-np.array(relative), kind="stable")
    return Candidates(
        np.array(poses).reshape(-1, 4, 4)[order], np.array(relative, np.float32)[order]
    )


class _Counter:
    """Counts matches and conflicts of the source over the target, in cells of one size."""

    def __init__(
        self, source: LevelledCloud, target: LevelledCloud, size: float, reach: float
    ) -> None:
        """Draw the target in cells of edge `size`; what shows clear cells counts up to `reach`."""
        self.size, self._source_cells = size, _cells_around(source, size, reach)
        cells = _cells_around(target, size, reach)
        grids = target.draw(np.eye(2), np.full(2, cells // 2 * size) - target.centre, cells, size)
        self._target = grids.grown, grids.clear, list_cells(grids.occupied)
        standing, showing = source.standing, source.showing
        self._source = (
            standing[0] - source.centre,
            standing[1],
            showing[0] - source.centre,
            showing[1],
        )

    def find(
        self,
        turns: Array,
        starts: NDArray[np.int64],
        centres: NDArray[np.int64],
        half_width: int,
        peaks: int,
    ) -> tuple[Array, NDArray[np.int64]]:
        """Find the best shifts in windows of shifts, see `find_shifts`."""
        scores, shifts = find_shifts(
            turns,
            starts,
            np.ascontiguousarray(centres),
            half_width,
            self._source,
            self._source_cells,
            self.size,
            self._target,
            np.array(CONFLICT_WEIGHTS),
            peaks,
            PEAK_RADIUS,
        )
        return scores, shifts


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


def _best_turns(scores: Array) -> NDArray[np.int64]:
    """Return the turns of the best peaks of each weight, by scores (turns, weights, peaks)."""
    best = np.argsort(-scores[:, :, 0], axis=0, kind="stable")[:TURNS_KEPT]
    return np.unique(best)


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
