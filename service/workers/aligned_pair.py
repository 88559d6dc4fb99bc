"""Base of the tasks that compare the moved source of a registration with its target."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mpe_core.options import Viewpoints
from service.clouds.deviation import build_surface, move_points
from service.clouds.inputs import CloudInput
from service.formats import DecodedCloud
from service.formats.surface import read_surface
from service.storage.blobs import blob_path
from service.workers.task import FileTask

if TYPE_CHECKING:
    from mpe_core import Deviation, MeshSurface, TargetSurface


@dataclass(frozen=True, slots=True)
class AlignedPair:
    """What a task needs to know of a registration that has succeeded."""

    transform: list[list[float]]
    """Pose of the source in the target's frame, (4, 4)."""
    source: CloudInput
    target: CloudInput
    target_viewpoint: Viewpoints | None
    """Position of the scanner in the target's frame, or of several, where the caller told it."""
    ignores_file_viewpoints: bool = False
    """Whether the positions that the target's file tells are not taken in its place."""


@dataclass(frozen=True, slots=True)
class PairTask(FileTask):
    """A file about both clouds of a registration."""

    pair: AlignedPair

    @property
    def readable(self) -> list[Path]:
        """The clouds."""
        return [self._path(self.pair.source), self._path(self.pair.target)]

    def _read(self, cloud: CloudInput) -> DecodedCloud:
        """Decode a cloud with its attributes; of a mesh, samples of its surface."""
        limits = self.environment.read_limits
        return read_surface(self._path(cloud), limits, **cloud.reading, attributes=True)

    def _build_surface(self, target: DecodedCloud | None = None) -> TargetSurface | MeshSurface:
        """Return the surface of the target, which is read unless it is given."""
        cloud = self._read(self.pair.target) if target is None else target
        return build_surface(
            cloud, self.pair.target_viewpoint, ignores_file=self.pair.ignores_file_viewpoints
        )

    def _measure(self, source: DecodedCloud, surface: TargetSurface | MeshSurface) -> Deviation:
        """Measure the distances of all points of the source."""
        from mpe_core import Deviation

        moved = move_points(source.points, self.pair.transform)
        return Deviation(np.asarray(surface.measure(moved)), surface.is_signed)

    def _path(self, cloud: CloudInput) -> Path:
        assert cloud.sha256 is not None  # noqa: S101
        return blob_path(self.environment.data_dir, cloud.sha256)
