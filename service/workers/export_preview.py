"""Task that writes a preview of a cloud of a registration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from service.clouds.preview import choose_rows, write_preview
from service.workers.aligned_pair import PairTask
from service.workers.messages import Exported
from service.workers.progress import ProgressReport


@dataclass(frozen=True, slots=True)
class ExportPreview(PairTask):
    """Write a thinned cloud to `output`; the source with its distances from the target."""

    role: Literal["source", "target"]
    max_points: int

    @property
    def output(self) -> Path:
        """The file that is written, in the scratch folder."""
        return self.environment.scratch / "preview.bin"

    def perform(self, report: ProgressReport) -> Exported:
        """Decode, thin, measure distances, write.

        Raises
        ------
        CloudFileError
            A file is no readable cloud.
        """
        cloud = self._read(self.pair.source if self.role == "source" else self.pair.target)
        rows = choose_rows(cloud.points, self.max_points)
        distances = None
        if self.role == "source":
            thinned = replace(cloud, points=cloud.points[rows])
            distances = self._measure(thinned, self._build_surface()).distances
        write_preview(self.output, cloud, rows, distances)
        return Exported()
