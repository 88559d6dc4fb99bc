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
from service.workers.aligned_pair import PairTask
from service.workers.messages import MAX_WARNINGS, Exported, clip
from service.workers.progress import ProgressReport

_SAMPLES = "surface_samples"
"""The choice that a written mesh does without: its vertices are moved, its faces are kept."""


@dataclass(frozen=True, slots=True)
class ExportAligned(PairTask):
    """Write the transformed source, with the target if that is wanted, to `output`."""

    is_merged: bool
    """Whether the target is appended."""
    has_distances: bool
    """Whether the distance of each point from the target's surface is written."""
    format: str
    """A key of service.formats.WRITERS."""

    @property
    def output(self) -> Path:
        """The file that is written, in the scratch folder."""
        return self.environment.scratch / f"aligned.{self.format}"

    def perform(self, report: ProgressReport) -> Exported:
        """Decode, transform, measure, write.

        Raises
        ------
        CloudFileError
            A file cannot be read with its attributes.
        """
        pair = self.pair
        warnings = write_aligned(
            self.output,
            self.format,
            np.array(pair.transform),
            read_crs(self._path(pair.target), self.environment.read_limits),
            partial(self._read_pieces, pair.source),
            partial(self._read_pieces, pair.target) if self.is_merged else None,
            self._build_surface().measure if self.has_distances else None,
        )
        return Exported([clip(text) for text in dict.fromkeys(warnings)][:MAX_WARNINGS])

    def _read_pieces(self, cloud: CloudInput) -> Iterator[DecodedCloud]:
        limits = self.environment.read_limits
        reading = {name: choice for name, choice in cloud.reading.items() if name != _SAMPLES}
        return read_pieces(self._path(cloud), limits, **reading, attributes=True)
