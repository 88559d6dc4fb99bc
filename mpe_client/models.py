"""What the service returns, as dataclasses with the names of its OpenAPI description.

A test compares them with openapi.yaml. Fields that a later release adds are ignored.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

JobStatus = Literal["queued", "running", "succeeded", "failed", "cancelled"]
TERMINAL: frozenset[JobStatus] = frozenset({"succeeded", "failed", "cancelled"})
"""Statuses of a registration that has ended."""


@dataclass(frozen=True, slots=True)
class Problem:
    """Problem document (RFC 9457)."""

    type: str
    """Stable name of the kind of problem, `urn:mpe:problem:...`."""
    title: str
    status: int
    detail: str
    """What is wrong here, and what to do."""
    errors: list[dict[str, str]] | None = None
    """For an invalid request: pointer and detail of each mistake."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a registration has come."""

    stage: str
    fraction: float
    """Share of the work that is done, in [0, 1]."""
    needs_label: str | None = None
    """Label of the workers that it waits for; None if any may run it."""


@dataclass(frozen=True, slots=True)
class Event:
    """State of a registration after one change."""

    at: datetime
    status: JobStatus
    stage: str
    fraction: float


@dataclass(frozen=True, slots=True)
class CloudInfo:
    """Where a cloud comes from and how it is decoded."""

    sha256: str | None
    size: int | None
    url: str | None
    cloud: str | None
    reading: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Rotation:
    """The rotation of a pose."""

    quaternion_xyzw: list[float]
    angle_deg: float


@dataclass(frozen=True, slots=True)
class InlierSummary:
    """Pairs of points that are closer than the threshold at the pose."""

    count: int
    ratio: float
    threshold: float
    pairs: list[list[int]] | None


@dataclass(frozen=True, slots=True)
class InlierList:
    """All inlier pairs, ordered by source index."""

    count: int
    threshold: float
    pairs: list[list[int]]
    distances: list[float]


@dataclass(frozen=True, slots=True)
class ResultWarning:
    """What to know before using a result."""

    code: str
    message: str


@dataclass(frozen=True, slots=True)
class Result:
    """The pose of the source in the target's frame, and how far to trust it."""

    transform: list[list[float]]
    """4x4, row-major, for column vectors: x_target = R x_source + t."""
    scale: float
    scale_deviation: float
    rotation: Rotation
    translation: list[float]
    overlap: float
    rmse: float
    energy: float
    confidence: float
    accepted: bool
    ambiguous: bool
    alternatives: list[list[list[float]]]
    covariance: list[list[float]]
    free_directions: list[list[float]]
    converged: bool
    iterations: int
    inliers: InlierSummary
    warnings: list[ResultWarning]


@dataclass(frozen=True, slots=True, kw_only=True)
class JobSummary:
    """A registration without its result."""

    id: str
    status: JobStatus
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    attempt: int
    progress: Progress
    source: CloudInfo
    target: CloudInfo
    options: dict[str, Any]
    labels: dict[str, str]
    priority: int
    deadline_at: datetime | None
    callback_url: str | None
    cached: bool
    result_expires_at: datetime | None
    expires_at: datetime | None
    timing: Mapping[str, float | None]
    confidence: float | None = None
    warnings: list[str]
    error: Problem | None

    @property
    def has_ended(self) -> bool:
        """Whether it has succeeded, failed or been cancelled."""
        return self.status in TERMINAL


@dataclass(frozen=True, slots=True, kw_only=True)
class Job(JobSummary):
    """A registration with its result."""

    result: Result | None

    def require_result(self) -> Result:
        """Return the result.

        Raises
        ------
        ValueError
            There is none: the registration has not succeeded.
        """
        if self.result is None:
            raise ValueError(f"registration {self.id} is {self.status}, and has no result")
        return self.result


@dataclass(frozen=True, slots=True)
class JobPage:
    """One page of registrations, newest first."""

    items: list[JobSummary]
    next_cursor: str | None


@dataclass(frozen=True, slots=True)
class Percentile:
    """A percentile of distances."""

    percent: float
    value: float | None


@dataclass(frozen=True, slots=True)
class ToleranceShare:
    """How many points lie within a tolerance."""

    tolerance: float
    share: float | None


@dataclass(frozen=True, slots=True)
class Deviation:
    """Statistics of the distances of the moved source points from the target's surface."""

    signed: bool
    count: int
    beyond: int
    mean: float | None
    std: float | None
    rms: float | None
    minimum: float | None
    maximum: float | None
    percentiles: list[Percentile]
    shares: list[ToleranceShare]
    histogram_edges: list[float]
    histogram_counts: list[int]


@dataclass(frozen=True, slots=True)
class Cloud:
    """A stored cloud."""

    id: str
    sha256: str
    size: int
    format: str
    created_at: datetime
    expires_at: datetime
