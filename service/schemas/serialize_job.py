"""Rows of the store as the documents of the API."""

from __future__ import annotations

from datetime import UTC, datetime

from service.clouds.inputs import CloudInput
from service.jobs.model import JobRow
from service.outbound.redact import shown
from service.schemas import CloudInfo, JobSummary, Problem, Progress, Timing
from service.storage.blobs import BlobStore


def summary(job: JobRow) -> JobSummary:
    """The job without its result."""
    return JobSummary(
        id=job.id,
        status=job.status,
        created_at=_time(job.created_at),
        started_at=_time_or_none(job.started_at),
        finished_at=_time_or_none(job.finished_at),
        attempt=job.attempt,
        progress=Progress(stage=job.stage, fraction=job.fraction),
        source=_cloud(job.source),
        target=_cloud(job.target),
        options=job.options,
        labels=job.labels,
        priority=job.priority,
        deadline_at=_time_or_none(job.deadline_at),
        callback_url=shown(job.callback_url),
        cached=job.cached,
        result_expires_at=_time_or_none(job.result_expires_at),
        expires_at=_time_or_none(job.expires_at),
        timing=Timing(**job.timing),
        warnings=job.warnings,
        error=None if job.error is None else Problem(**job.error),
    )


def _cloud(cloud: CloudInput) -> CloudInfo:
    return CloudInfo(
        sha256=cloud.sha256,
        size=cloud.size,
        url=shown(cloud.url),
        cloud=cloud.cloud,
        reading=cloud.reading,
    )


def document(job: JobRow, blobs: BlobStore) -> bytes:
    """JSON of the whole job; the result was rendered by the worker and is spliced in as it is."""
    result = b"null"
    if job.result_sha256 is not None:
        result = blobs.path(job.result_sha256).read_bytes()
    return summary(job).model_dump_json().encode()[:-1] + b',"result":' + result + b"}"


def _time(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, UTC)


def _time_or_none(seconds: float | None) -> datetime | None:
    return None if seconds is None else _time(seconds)
