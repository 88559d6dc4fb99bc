"""Task that decodes two stored clouds, registers them and writes the result."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpe_core import RegistrationOptions
from service.clouds.file_viewpoints import with_file_viewpoints
from service.clouds.inputs import CloudInput
from service.clouds.register_files import register_files
from service.formats import (
    CloudFileError,
    DecodedCloud,
    read_surface,
    warn_unlike,
)
from service.storage.blobs import blob_path
from service.storage.decoded_cache import decoded_path, load_or_decode
from service.workers.messages import MAX_WARNINGS, Succeeded, clip
from service.workers.progress import ProgressReport
from service.workers.task import Task

if TYPE_CHECKING:
    from mpe_core import Registration

DECODING_SHARE = 0.1
"""Share of an attempt's progress that stands for fetching and decoding."""
RESULT_NAME, INLIERS_NAME = "result.json", "inliers.npy"
"""Files in the scratch folder: the result as the API serves it, and the inlier pairs."""


def is_cached_decoded(cloud: CloudInput) -> bool:
    """Return whether the decoded cloud is cached: other registrations will refer to it."""
    return cloud.cloud is not None and not cloud.reading


@dataclass(frozen=True, slots=True)
class RegisterClouds(Task):
    """Register two stored clouds."""

    source: CloudInput
    target: CloudInput
    options: dict[str, Any]
    """Arguments of RegistrationOptions."""

    @property
    def readable(self) -> list[Path]:
        """Both clouds, and their decoded forms."""
        clouds = (self.source, self.target)
        return [
            *map(self._path, clouds),
            *(self._entry(cloud) for cloud in clouds if is_cached_decoded(cloud)),
        ]

    def perform(self, report: ProgressReport) -> Succeeded:
        """Decode, register, write the result.

        Raises
        ------
        CloudFileError
            A file is no readable cloud.
        mpe_core.RegistrationError
            The clouds cannot be registered.
        """
        report.send("decode", DECODING_SHARE / 2)
        with report.stage("decode"):
            source = self._decode("source", self.source)
            target = self._decode("target", self.target)
        options, told = with_file_viewpoints(RegistrationOptions(**self.options), source, target)
        registration = self._register(source, target, options, report)
        with report.stage("store"):
            about_both = (*told, *warn_unlike(source.crs, target.crs))
            read = [clip(text) for text in (*source.warnings, *target.warnings, *about_both)]
            _write(registration, read[:MAX_WARNINGS], self.environment.scratch)
        warnings = [*read, *map(str, registration.warnings)]
        return Succeeded(
            confidence=registration.confidence,
            warnings=[clip(text) for text in warnings[:MAX_WARNINGS]],
            timing=report.timing,
        )

    def _path(self, cloud: CloudInput) -> Path:
        assert cloud.sha256 is not None  # noqa: S101
        return blob_path(self.environment.data_dir, cloud.sha256)

    def _entry(self, cloud: CloudInput) -> Path:
        assert cloud.sha256 is not None  # noqa: S101
        return decoded_path(self.environment.data_dir, self.environment.tenant, cloud.sha256)

    def _decode(self, role: str, cloud: CloudInput) -> DecodedCloud:
        path, scratch = self._path(cloud), self.environment.scratch
        limits = self.environment.read_limits
        try:
            if is_cached_decoded(cloud):
                decoded = load_or_decode(
                    self._entry(cloud),
                    lambda: read_surface(path, limits),
                    scratch,
                    limits,
                )
            else:
                decoded = read_surface(path, limits, **cloud.reading)
        except CloudFileError as error:
            raise type(error)(f"{role}: {error}") from error
        return replace(decoded, warnings=tuple(f"{role}: {text}" for text in decoded.warnings))

    def _register(
        self,
        source: DecodedCloud,
        target: DecodedCloud,
        options: RegistrationOptions,
        report: ProgressReport,
    ) -> Registration:
        import numba

        numba.set_num_threads(min(self.environment.threads, numba.config.NUMBA_NUM_THREADS))
        registration = register_files(
            source,
            target,
            options,
            lambda stage, fraction: report.send(
                stage, DECODING_SHARE + (1 - DECODING_SHARE) * fraction
            ),
        )
        for stage, seconds in registration.timing.items():
            if stage != "total":
                report.timing[f"{stage}_s"] = seconds
        return registration


def _write(registration: Registration, file_warnings: list[str], scratch: Path) -> None:
    """Write the result document, with what reading the files said, and the inlier pairs."""
    from service.schemas.inlier_file import write_inliers
    from service.schemas.serialize_result import render_result

    (scratch / RESULT_NAME).write_bytes(render_result(registration, file_warnings))
    write_inliers(scratch / INLIERS_NAME, registration.inliers)
