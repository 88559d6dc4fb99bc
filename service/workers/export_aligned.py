"""Task that writes the source of a registration in the frame of its target."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from service.clouds.aligned import write_aligned
from service.clouds.inputs import CloudInput
from service.formats import DecodedCloud, read_crs, read_pieces
from service.storage.blobs import blob_path
from service.workers.messages import MAX_WARNINGS, Exported, clip
from service.workers.progress import ProgressReport
from service.workers.task import FileTask

_SAMPLES = "surface_samples"
"""The choice that a written mesh does without: its vertices are moved, its faces are kept."""


@dataclass(frozen=True, slots=True)
class ExportAligned(FileTask):
    """Write the transformed source, with the target if that is wanted, to `output`."""

    transform: list[list[float]]
    """Pose of the source in the target's frame, (4, 4)."""
    source: CloudInput
    target: CloudInput
    """The cloud in whose frame the source is written."""
    is_merged: bool
    """Whether the target is appended."""
    format: str
    """A key of service.formats.WRITERS."""

    @property
    def output(self) -> Path:
        """The file that is written, in the scratch folder."""
        return self.environment.scratch / f"aligned.{self.format}"

    @property
    def readable(self) -> list[Path]:
        """The clouds."""
        return [self._path(cloud) for cloud in (self.source, self.target)]

    def perform(self, report: ProgressReport) -> Exported:
        """Decode, transform, write.

        Raises
        ------
        CloudFileError
            A file cannot be read with its attributes.
        """
        warnings = write_aligned(
            self.output,
            self.format,
            np.array(self.transform),
            read_crs(self._path(self.target), self.environment.read_limits),
            partial(self._read, self.source),
            partial(self._read, self.target) if self.is_merged else None,
        )
        return Exported([clip(text) for text in dict.fromkeys(warnings)][:MAX_WARNINGS])

    def _read(self, cloud: CloudInput) -> Iterator[DecodedCloud]:
        limits = self.environment.read_limits
        reading = {name: choice for name, choice in cloud.reading.items() if name != _SAMPLES}
        return read_pieces(self._path(cloud), limits, **reading, attributes=True)

    def _path(self, cloud: CloudInput) -> Path:
        assert cloud.sha256 is not None  # noqa: S101
        return blob_path(self.environment.data_dir, cloud.sha256)
