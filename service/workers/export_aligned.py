"""Task that writes the source of a registration in the frame of its target."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from service.clouds.inputs import CloudInput
from service.clouds.transform import merge_clouds, transform_cloud
from service.formats import DecodedCloud, read_points, write_cloud
from service.storage.blobs import BlobStore
from service.workers.messages import Exported
from service.workers.progress import ProgressReport
from service.workers.task import Task


@dataclass(frozen=True, slots=True)
class ExportAligned(Task):
    """Write the transformed source, with the target if that is wanted, to `output`."""

    transform: list[list[float]]
    """Pose of the source in the target's frame, (4, 4)."""
    source: CloudInput
    target: CloudInput | None
    """The cloud to be appended, if any."""
    format: str
    """A key of service.formats.WRITERS."""

    @property
    def output(self) -> Path:
        """The file that is written, in the scratch folder."""
        return self.environment.scratch / f"aligned.{self.format}"

    def perform(self, report: ProgressReport) -> Exported:
        """Decode, transform, write.

        Raises
        ------
        CloudFileError
            A file cannot be read with its attributes.
        """
        cloud = transform_cloud(self._decode(self.source), np.array(self.transform))
        if self.target is not None:
            cloud = merge_clouds(cloud, self._decode(self.target))
        write_cloud(self.output, self.format, cloud.points, cloud.attributes)
        return Exported()

    def _decode(self, cloud: CloudInput) -> DecodedCloud:
        assert cloud.sha256 is not None  # noqa: S101
        blobs = BlobStore(self.environment.data_dir, incoming=self.environment.scratch)
        return read_points(blobs.path(cloud.sha256), **cloud.reading, attributes=True)
