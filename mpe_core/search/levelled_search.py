"""Search over four degrees of freedom for levelled scenes: a turn about the vertical and a shift.

Two scans that show one ground are seen from above, as occupancy grids (Moravec and Elfes 1985) at a
few heights over the ground. A cell is occupied if points lie in it, and clear if the scan shows a
surface there but nothing at that height. For each turn, cross-correlation by FFT counts for all
shifts at once how many occupied cells meet occupied ones, and how many meet clear ones, first in
coarse cells, then in fine ones at the best turns:

    score(turn, shift) = matches - conflict_weight * conflicts

Unlike the overlap of points, this counts against a pose what should be seen at it and is not: large
flat surfaces that slide on themselves say nothing, and a small overlap that fits beats a large one
that does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from mpe_core.geometry.rigid import pose
from mpe_core.progress import FractionCallback
from mpe_core.search.levelled_cloud import CELL_SIZE, Grid, LevelledCloud
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

SHIFTS_PER_TURN = 4
"""Peaks that are taken for each turn and each weight."""

PEAK_RADIUS = 3
"""Cells around a peak in which no other is taken."""


@dataclass(frozen=True, slots=True)
class _Peak:
    """Turn and shift (2,) whose score is the highest around."""

    score: float
    turn: float
    shift: Array


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
    width = 2 * MAX_SHIFT_SHARE * (source.radius + target.radius)
    size = max(CELL_SIZE, width / MAX_GRID_CELLS)
    turns = np.radians(np.arange(0.0, 360.0, TURN_STEP_DEG))
    coarse = _find_peaks(
        _Correlation(source, target, width, COARSE_CELLS * size),
        turns,
        lambda share: report(share / 2),
    )
    peaks = _find_peaks(
        _Correlation(source, target, width, size),
        np.unique([_best_turns(found) for found in coarse]),
        lambda share: report(0.5 + share / 2),
    )
    poses, scores = [], []
    for found in peaks:
        best = max(found[0].score, 1e-9)
        for peak in found[:count]:
            if peak.score > 0:
                poses.append(_pose(source, target, peak.turn, peak.shift))
                scores.append(peak.score / best)
    order = np.argsort(-np.array(scores), kind="stable")
    return Candidates(np.array(poses).reshape(-1, 4, 4)[order], np.array(scores, np.float32)[order])


class _Correlation:
    """Matches and conflicts of all shifts of the source over the target, in cells of one size."""

    def __init__(
        self, source: LevelledCloud, target: LevelledCloud, width: float, size: float
    ) -> None:
        """Draw the target into grids at least `width` wide, of cells of edge `size`."""
        self._source, self.size = source, size
        self._cells = fft.next_fast_len(int(np.ceil(width / size)) + 4, real=True)
        self._middle = np.full(2, self._cells * size / 2)
        fixed = target.draw(np.eye(2), self._middle - target.centre, self._cells, size)
        self._grown, self._clear, self._occupied = (
            np.conj(_transform(grid)) for grid in (fixed.grown, fixed.clear, fixed.occupied)
        )

    def count(self, turn: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(n, n) matches and (n, n) conflicts at each shift of the turned source."""
        R = _turn(turn)
        shift = self._middle - R @ self._source.centre
        moving = self._source.draw(R, shift, self._cells, self.size)
        occupied, clear = _transform(moving.occupied), _transform(moving.clear)
        matches = _correlate(occupied * self._grown, self._cells)
        conflicts = occupied * self._clear + clear * self._occupied
        return matches, _correlate(conflicts, self._cells)


def _find_peaks(
    correlation: _Correlation, turns: Array, report: FractionCallback
) -> list[list[_Peak]]:
    """Peaks of each of CONFLICT_WEIGHTS at the turns, the best first."""
    peaks: list[list[_Peak]] = [[] for _ in CONFLICT_WEIGHTS]
    for done, turn in enumerate(turns):
        report(done / len(turns))
        matches, conflicts = correlation.count(turn)
        for found, weight in zip(peaks, CONFLICT_WEIGHTS, strict=True):
            found += [
                _Peak(score, turn, correlation.size * steps)
                for score, steps in _peaks(matches - weight * conflicts)
            ]
    for found in peaks:
        found.sort(key=lambda peak: -peak.score)
    return peaks


def _best_turns(peaks: list[_Peak]) -> list[float]:
    """Return the turns of the best peaks."""
    return list(dict.fromkeys(peak.turn for peak in peaks))[:TURNS_KEPT]


def _peaks(score: NDArray[np.float32]) -> list[tuple[float, Array]]:
    """Highest cells of a correlation (n, n), with the shifts (2,) in cells that they stand for."""
    cells = len(score)
    around = np.arange(-PEAK_RADIUS, PEAK_RADIUS + 1)
    found = []
    for _ in range(SHIFTS_PER_TURN):
        row, column = np.unravel_index(int(np.argmax(score)), score.shape)
        steps = np.array([row, column], np.float64)
        steps[steps > cells // 2] -= cells
        found.append((float(score[row, column]), -steps))
        score[np.ix_((row + around) % cells, (column + around) % cells)] = -np.inf
    return found


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


def _transform(grid: Grid) -> NDArray[np.complex64]:
    spectrum = fft.rfft2(grid.astype(np.float32), workers=numba.get_num_threads())
    return spectrum.astype(np.complex64, copy=False)


def _correlate(spectrum: NDArray[np.complex64], cells: int) -> NDArray[np.float32]:
    """(n, n) cross-correlation, summed over the layers."""
    summed: NDArray[np.float32] = fft.irfft2(
        spectrum.sum(axis=0), s=(cells, cells), workers=numba.get_num_threads()
    )
    return summed
