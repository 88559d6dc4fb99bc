"""A registration as the service stores it.

State machine of a job; `service.jobs.transitions` makes every change of it::

    accepted --> queued --claim--> running --succeed--> succeeded
       |           |  ^               |----fail-------> failed
       |           |  +---requeue-----|                    ^
       |           |   (or a lost     +----cancel-----> cancelled
       |           |    attempt, or                        ^
       |           |    fetched)                           |
       |           +--cancel-------------------------------+
       |           +--deadline passed--> failed
       +--result of the same work is kept--> succeeded

A job whose clouds are URLs is claimed from the queue `fetch` first; once they are stored, it goes
to the queue `register`, or to `large` where its clouds are large (`service.jobs.sizes`). A job that
runs out of memory goes from `register` to `large`. None goes back. Each claim begins an attempt and
increases `JobRow.attempt`; the claim after a fetch goes on with the attempt of the fetch. Queue and
number are a fencing token: what a worker writes counts only while the job is running and both are
still the worker's. An attempt whose child process ends without an answer returns the job to its
queue; the third one fails it. An attempt that is interrupted from outside (the service died, the
disk was full) returns the job to its queue too; `MAX_INTERRUPTIONS` of them, with pauses that grow,
fail it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from service.clouds.inputs import CloudInput

JobStatus = Literal["queued", "running", "succeeded", "failed", "cancelled"]
JobQueue = Literal["fetch", "register", "large"]
JOB_STATUSES: tuple[JobStatus, ...] = get_args(JobStatus)
TERMINAL_STATUSES: tuple[JobStatus, ...] = ("succeeded", "failed", "cancelled")
DeliveryStatus = Literal["pending", "sending", "delivered", "failed"]


def is_terminal(status: JobStatus) -> bool:
    """Return whether a job of this status never changes again."""
    return status in TERMINAL_STATUSES


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a successful attempt leaves behind."""

    result_sha256: str
    """Blob: the result as the JSON text that the API serves."""
    inliers_sha256: str
    """Blob: the inlier pairs as .npy."""
    result_bytes: int
    """Length of both blobs together."""
    confidence: float
    """As in the result, in [0, 1]."""
    source: CloudInput
    target: CloudInput
    timing: dict[str, float]
    """Seconds by stage, keys as in the API."""
    warnings: list[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class JobRow:
    """One row of the jobs table; times in seconds since the epoch, UTC."""

    id: str
    tenant: str
    source: CloudInput
    target: CloudInput
    options: dict[str, Any]
    created_at: float
    status: JobStatus = "queued"
    queue: JobQueue = "register"
    """Where it waits, or was claimed from; set when the job is accepted."""
    started_at: float | None = None
    """Begin of the last attempt."""
    finished_at: float | None = None
    attempt: int = 0
    """Number of the last attempt, counted from 1; 0 before the first."""
    lost_attempts: int = 0
    """Attempts whose child process ended without an answer while the service lived."""
    interruptions: int = 0
    """Attempts that ended for a reason outside of the job: the service died, the disk was full."""
    paused_until: float | None = None
    """The queued job is not claimed before; grows with the interruptions."""
    lease_until: float | None = None
    """When the running attempt is lost unless its worker extends the lease."""
    stage: str = "queued"
    fraction: float = 0.0
    """Progress in [0, 1]."""
    timing: dict[str, float] = field(default_factory=dict)
    """Seconds by stage, keys as in the API."""
    warnings: list[str] = field(default_factory=list)
    error: dict[str, Any] | None = None
    """Problem document of a failed job."""
    result_sha256: str | None = None
    inliers_sha256: str | None = None
    result_bytes: int | None = None
    confidence: float | None = None
    labels: dict[str, str] = field(default_factory=dict)
    priority: int = 0
    """Among the jobs of a tenant the highest is claimed first."""
    deadline_at: float | None = None
    work_key: str | None = None
    """Hash of clouds, options and release: jobs with equal keys have equal results."""
    cached: bool = False
    """Whether the result is that of an earlier job."""
    callback_url: str | None = None
    result_expires_at: float | None = None
    expires_at: float | None = None


@dataclass(frozen=True, slots=True)
class JobEvent:
    """State of a job after one change of its row."""

    number: int
    """Counted from 1 for each job."""
    at: float
    """Seconds since the epoch, UTC."""
    status: JobStatus
    stage: str
    fraction: float


@dataclass(frozen=True, slots=True)
class Retention:
    """How long a job is kept after its end, in seconds."""

    result_s: float
    """The result, and the clouds that it was computed from."""
    job_s: float
    """The row of the job."""
