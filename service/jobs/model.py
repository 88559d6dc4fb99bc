"""One row of the job store."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from service.clouds.inputs import CloudInput

JobStatus = Literal["queued", "running", "succeeded", "failed", "cancelled"]
DeliveryStatus = Literal["pending", "sending", "delivered", "failed"]


ENDED: tuple[JobStatus, ...] = ("succeeded", "failed", "cancelled")


def is_terminal(status: JobStatus) -> bool:
    """Whether nothing will happen to the job any more."""
    return status in ENDED


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a successful attempt leaves behind."""

    result_sha256: str
    """Blob: the result as the JSON text that the API serves."""
    inliers_sha256: str
    """Blob: the inlier pairs as .npy."""
    result_bytes: int
    """Length of the two together."""
    confidence: float
    """As in the result, in [0, 1]."""
    source: CloudInput
    target: CloudInput
    timing: dict[str, float]
    """Seconds by stage, keys as in the API."""
    warnings: list[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class JobRow:
    """A registration as the store knows it; times in seconds since the epoch, UTC."""

    id: str
    tenant: str
    source: CloudInput
    target: CloudInput
    options: dict[str, Any]
    created_at: float
    status: JobStatus = "queued"
    started_at: float | None = None
    finished_at: float | None = None
    attempt: int = 0
    lost_attempts: int = 0
    lease_until: float | None = None
    stage: str = "queued"
    fraction: float = 0.0
    timing: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    error: dict[str, Any] | None = None
    result_sha256: str | None = None
    inliers_sha256: str | None = None
    result_bytes: int | None = None
    confidence: float | None = None
    labels: dict[str, str] = field(default_factory=dict)
    priority: int = 0
    deadline_at: float | None = None
    work_key: str | None = None
    cached: bool = False
    callback_url: str | None = None
    result_expires_at: float | None = None
    expires_at: float | None = None


@dataclass(frozen=True, slots=True)
class JobEvent:
    """A job as it was after one change of its row."""

    number: int
    at: float
    status: JobStatus
    stage: str
    fraction: float


@dataclass(frozen=True, slots=True)
class Retention:
    """How long what has ended is kept, in seconds."""

    result_s: float
    job_s: float
