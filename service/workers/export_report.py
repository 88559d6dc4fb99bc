"""Tasks that write the report and the picture of a registration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from service.clouds.deviation import count_histogram, move_points
from service.report.page import ReportContent, render_report
from service.report.pictures import draw_before_after, draw_distances
from service.workers.aligned_pair import PairTask
from service.workers.messages import Exported
from service.workers.progress import ProgressReport

if TYPE_CHECKING:
    from mpe_core import Deviation

_REACH_FACTOR = 3.0
"""Distances count up to so many inlier thresholds: points beyond have no counterpart."""
_COLOR_FACTOR = 2.0
"""Ends of the colours and of the histogram over the distance that 90 % of the points keep."""


@dataclass(frozen=True, slots=True)
class ExportPicture(PairTask):
    """Write a picture of both clouds, before and after, to `output`."""

    @property
    def output(self) -> Path:
        """The file that is written, in the scratch folder."""
        return self.environment.scratch / "preview.png"

    def perform(self, report: ProgressReport) -> Exported:
        """Decode, draw, write.

        Raises
        ------
        CloudFileError
            A file is no readable cloud.
        """
        source, target = (
            self._read(cloud).points.astype(np.float64)
            for cloud in (self.pair.source, self.pair.target)
        )
        moved = move_points(source, self.pair.transform)
        self.output.write_bytes(draw_before_after(source, moved, target))
        return Exported()


@dataclass(frozen=True, slots=True)
class ExportReport(PairTask):
    """Write the report as one HTML file to `output`."""

    job: dict[str, Any]
    """The registration as the API renders it, without its result."""
    result: dict[str, Any]
    tolerances: list[float]
    unit: str | None
    """Name of the unit of the files, as the caller gives it."""
    release: str

    @property
    def output(self) -> Path:
        """The file that is written, in the scratch folder."""
        return self.environment.scratch / "report.html"

    def perform(self, report: ProgressReport) -> Exported:
        """Decode, measure, draw, write.

        Raises
        ------
        CloudFileError
            A file is no readable cloud.
        """
        target, source = self._read(self.pair.target), self._read(self.pair.source)
        deviation = self._measure(source, self._build_surface(target))
        page = compose_report(
            self.job,
            self.result,
            source.points.astype(np.float64),
            target.points.astype(np.float64),
            deviation,
            tolerances=self.tolerances,
            unit=self.unit,
            release=self.release,
        )
        self.output.write_text(page, encoding="utf-8")
        return Exported()


def compose_report(
    job: dict[str, Any],
    result: dict[str, Any],
    source: NDArray[np.float64],
    target: NDArray[np.float64],
    deviation: Deviation,
    *,
    tolerances: Sequence[float],
    unit: str | None,
    release: str,
) -> str:
    """Return the report of a result as one page of HTML.

    Parameters
    ----------
    job, result
        Registration and result as the API renders them.
    source, target : (N, 3), (M, 3)
        The points of the files.
    deviation
        Distances of the moved source from the target.
    tolerances, unit, release
        As for `ReportContent`.
    """
    from service.schemas.deviation import render_deviation

    most = _REACH_FACTOR * result["inliers"]["threshold"]
    summary = deviation.summarize(tolerances, most)
    reach = choose_reach(summary.percentiles, most)
    histogram = count_histogram(deviation.distances, reach, deviation.is_signed)
    moved = move_points(source, result["transform"])
    low = -reach if deviation.is_signed else 0.0
    return render_report(
        ReportContent(
            job=job,
            result=result,
            deviation=render_deviation(summary, deviation.is_signed, histogram).model_dump(),
            sizes=(len(source), len(target)),
            unit=unit,
            reach=reach,
            release=release,
            before_after=draw_before_after(source, moved, target),
            sides=draw_distances(moved, deviation.distances, target, low, reach),
        )
    )


def choose_reach(percentiles: Mapping[int, float], most: float) -> float:
    """Return the distance at the ends of the colours, at most `most`."""
    common = _COLOR_FACTOR * max(abs(percentiles[5]), abs(percentiles[95]))
    return min(common, most) if 0 < common < float("inf") else most
