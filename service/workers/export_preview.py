"""Task that writes a preview of a cloud of a registration."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from service.clouds.inputs import CloudInput
from service.clouds.preview import choose_rows, find_distances, write_preview
from service.formats import DecodedCloud, read_points
from service.storage.blobs import blob_path
from service.workers.messages import Exported
from service.workers.progress import ProgressReport
from service.workers.task import FileTask


@dataclass(frozen=True, slots=True)
class ExportPreview(FileTask):
    """Write a thinned cloud to `output`, with distances from a target if one is given."""

    cloud: CloudInput
    max_points: int
    transform: list[list[float]] | None = None
    """Pose of the cloud in the target's frame, (4, 4); None: without distances."""
    target: CloudInput | None = None
    """The cloud that distances are measured from; None: without distances."""

    @property
    def output(self) -> Path:
        """The file that is written, in the scratch folder."""
        return self.environment.scratch / "preview.bin"

    @property
    def readable(self) -> list[Path]:
        """The clouds."""
        return [self._path(cloud) for cloud in (self.cloud, self.target) if cloud is not None]

    def perform(self, report: ProgressReport) -> Exported:
        """Decode, thin, measure distances, write.

        Raises
        ------
        CloudFileError
            A file is no readable cloud.
        """
        cloud = self._read(self.cloud, attributes=True)
        rows = choose_rows(cloud.points, self.max_points)
        distances = None
        if self.target is not None and self.transform is not None:
            source = cloud.points[rows].astype(np.float64)
            target = self._read(self.target).points.astype(np.float64)
            distances = find_distances(source, target, np.array(self.transform))
        write_preview(self.output, cloud, rows, distances)
        return Exported()

    def _read(self, cloud: CloudInput, *, attributes: bool = False) -> DecodedCloud:
        limits = self.environment.read_limits
        reading = {**cloud.reading}
        return read_points(self._path(cloud), limits, **reading, attributes=attributes)

    def _path(self, cloud: CloudInput) -> Path:
        assert cloud.sha256 is not None  # noqa: S101
        return blob_path(self.environment.data_dir, cloud.sha256)
