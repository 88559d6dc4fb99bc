"""Task that writes the statistics of the distances of a source from its target."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from service.clouds.deviation import count_histogram
from service.workers.aligned_pair import PairTask
from service.workers.messages import Exported
from service.workers.progress import ProgressReport


@dataclass(frozen=True, slots=True)
class ExportDeviation(PairTask):
    """Write a `Deviation` as JSON to `output`."""

    tolerances: list[float]
    max_distance: float | None
    """Points farther away do not count; None: all count."""

    @property
    def output(self) -> Path:
        """The file that is written, in the scratch folder."""
        return self.environment.scratch / "deviation.json"

    def perform(self, report: ProgressReport) -> Exported:
        """Decode, measure, write.

        Raises
        ------
        CloudFileError
            A file is no readable cloud.
        """
        from service.schemas.deviation import render_deviation

        deviation = self._measure(self._read(self.pair.source), self._build_surface())
        limit = float("inf") if self.max_distance is None else self.max_distance
        summary = deviation.summarize(self.tolerances, limit)
        reach = max(abs(summary.percentiles[1]), abs(summary.percentiles[99]))
        histogram = count_histogram(deviation.distances, reach, deviation.is_signed)
        document = render_deviation(summary, deviation.is_signed, histogram)
        self.output.write_text(document.model_dump_json())
        return Exported()
