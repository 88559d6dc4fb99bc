"""Task that decodes two stored clouds, registers them and stores the result."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpe_core import RegistrationOptions
from service.clouds.inputs import CloudInput
from service.formats import CloudFileError, DecodedCloud, read_points
from service.storage.blobs import Blob, BlobStore
from service.storage.decoded_cache import DecodedCache
from service.workers.messages import MAX_WARNINGS, StoredBlob, Succeeded, clip
from service.workers.progress import ProgressReport
from service.workers.task import Task

if TYPE_CHECKING:
    from mpe_core import Registration

DECODING_SHARE = 0.1
"""Share of an attempt's progress that stands for fetching and decoding."""


@dataclass(frozen=True, slots=True)
class RegisterClouds(Task):
    """Register two stored clouds."""

    source: CloudInput
    target: CloudInput
    options: dict[str, Any]
    """Arguments of RegistrationOptions."""

    def perform(self, report: ProgressReport) -> Succeeded:
        """Decode, register, store the result.

        Raises
        ------
        CloudFileError
            A file is no readable cloud.
        mpe_core.RegistrationError
            The clouds cannot be registered.
        """
        environment = self.environment
        blobs = BlobStore(environment.data_dir, incoming=environment.scratch)
        report.send("decode", DECODING_SHARE / 2)
        with report.stage("decode"):
            source = self._decode("source", self.source, blobs)
            target = self._decode("target", self.target, blobs)
        registration = self._register(source, target, report)
        with report.stage("store"):
            result, inliers = _store(registration, blobs)
        warnings = [*source.warnings, *target.warnings, *registration.warnings]
        return Succeeded(
            result=result,
            inliers=inliers,
            confidence=registration.confidence,
            warnings=[clip(text) for text in warnings[:MAX_WARNINGS]],
            timing=report.timing,
        )

    def _decode(self, role: str, cloud: CloudInput, blobs: BlobStore) -> DecodedCloud:
        assert cloud.sha256 is not None  # noqa: S101
        path, environment = blobs.path(cloud.sha256), self.environment
        try:
            if cloud.cloud is None or cloud.reading:
                decoded = read_points(path, **cloud.reading)
            else:  # a stored cloud: other registrations will refer to it
                cache = DecodedCache(environment.data_dir / "prepared")
                decoded = cache.get_or_decode(
                    environment.tenant, cloud.sha256, lambda: read_points(path), environment.scratch
                )
        except CloudFileError as error:
            raise type(error)(f"{role}: {error}") from error
        return replace(decoded, warnings=tuple(f"{role}: {text}" for text in decoded.warnings))

    def _register(
        self, source: DecodedCloud, target: DecodedCloud, report: ProgressReport
    ) -> Registration:
        import numba

        from mpe_core import register

        numba.set_num_threads(min(self.environment.threads, numba.config.NUMBA_NUM_THREADS))
        registration = register(
            source.points,
            target.points,
            RegistrationOptions(**self.options),
            source_weights=source.weights,
            target_weights=target.weights,
            on_progress=lambda stage, fraction: report.send(
                stage, DECODING_SHARE + (1 - DECODING_SHARE) * fraction
            ),
        )
        for stage, seconds in registration.timing.items():
            if stage != "total":
                report.timing[f"{stage}_s"] = seconds
        return registration


def _store(registration: Registration, blobs: BlobStore) -> tuple[StoredBlob, StoredBlob]:
    """Store the result document and the inlier pairs."""
    from service.schemas.serialize_result import inlier_array, render_result

    result = blobs.put([render_result(registration)])
    buffer = io.BytesIO()
    np.save(buffer, inlier_array(registration.inliers), allow_pickle=False)
    inliers = blobs.put([buffer.getvalue()])
    return _reference(result), _reference(inliers)


def _reference(blob: Blob) -> StoredBlob:
    return StoredBlob(blob.sha256, blob.size)
